//! The catalogue of waveforms and the form in which a caller names them.

/// A parameter of a waveform. An empty unit means the unit of the quantity the waveform drives.
#[derive(Clone, Copy, Debug)]
pub struct WaveParameter {
    pub name: &'static str,
    pub unit: &'static str,
    pub default: Option<f64>,
    pub text: &'static str,
}

/// A kind of waveform and its parameters, in the order of `Term::parameters`.
#[derive(Clone, Copy, Debug)]
pub struct WaveRecord {
    pub wave: Wave,
    pub kind: &'static str,
    pub text: &'static str,
    pub parameters: &'static [WaveParameter],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wave {
    Constant,
    Step,
    Ramp,
    Sine,
    Chirp,
    PeriodSweep,
    Triangle,
    Trapezoid,
    Rectangle,
    Table,
}

const fn p(name: &'static str, unit: &'static str, default: Option<f64>, text: &'static str) -> WaveParameter {
    WaveParameter { name, unit, default, text }
}

const START: WaveParameter = p("start", "s", Some(0.0), "before it the term holds its starting value");
const END: WaveParameter = p("end", "s", Some(f64::INFINITY), "after it the term holds the value it had then");
const BIAS: WaveParameter = p("bias", "", Some(0.0), "mean value");
const ACCELERATION: WaveParameter = p(
    "acceleration",
    "/s2",
    Some(0.0),
    "largest second derivative: corners become parabolas and the motion begins from rest; 0: sharp corners",
);
const REPEAT: WaveParameter = p("repeat", "1", Some(1.0), "1: starts again after its last point, 0: holds its last value");

/// Every waveform.
pub fn catalogue() -> &'static [WaveRecord] {
    const CATALOGUE: &[WaveRecord] = &[
        WaveRecord { wave: Wave::Constant, kind: "constant", text: "one value", parameters: &[p("value", "", None, "the value")] },
        WaveRecord {
            wave: Wave::Step,
            kind: "step",
            text: "initial value, then the final one from a time on",
            parameters: &[p("initial", "", Some(0.0), "value before the step"), p("final", "", None, "value after the step"), p("time", "s", Some(0.0), "time of the step")],
        },
        WaveRecord {
            wave: Wave::Ramp,
            kind: "ramp",
            text: "constant slope between start and end",
            parameters: &[p("initial", "", Some(0.0), "value before the ramp"), p("slope", "/s", None, "slope"), START, END],
        },
        WaveRecord {
            wave: Wave::Sine,
            kind: "sine",
            text: "bias + amplitude sin(2 pi frequency (t - start) + phase)",
            parameters: &[p("amplitude", "", None, "peak value"), p("frequency", "Hz", None, "frequency"), p("phase", "rad", Some(0.0), "phase at start"), BIAS, START, END],
        },
        WaveRecord {
            wave: Wave::Chirp,
            kind: "chirp",
            text: "sine whose frequency runs linearly from the first to the last one during the sweep",
            parameters: &[
                p("amplitude", "", None, "peak value"),
                p("start_frequency", "Hz", Some(0.0), "frequency at the start of the sweep"),
                p("end_frequency", "Hz", None, "frequency at the end of the sweep"),
                p("sweep_time", "s", None, "duration of the sweep"),
                p("phase", "rad", Some(0.0), "phase at the start of the sweep"),
                BIAS,
                START,
                p("repeat", "1", Some(0.0), "1: sweeps again from the start, 0: holds its last value"),
            ],
        },
        WaveRecord {
            wave: Wave::PeriodSweep,
            kind: "period_sweep",
            text: "one sine cycle after another whose period runs linearly from the first to the last one during the sweep; position and speed are continuous",
            parameters: &[
                p("amplitude", "", None, "peak value"),
                p("start_period", "s", None, "period at the start of the sweep"),
                p("end_period", "s", None, "period at the end of the sweep"),
                p("sweep_time", "s", None, "duration of the sweep"),
                BIAS,
                START,
                p("repeat", "1", Some(0.0), "1: sweeps again from the start, 0: holds its last value"),
            ],
        },
        WaveRecord {
            wave: Wave::Triangle,
            kind: "triangle",
            text: "triangle about the bias, rising through it at start when the phase is zero",
            parameters: &[p("amplitude", "", None, "peak value"), p("frequency", "Hz", None, "frequency"), p("phase", "rad", Some(0.0), "phase at start, 2 pi a period"), BIAS, START, END, ACCELERATION],
        },
        WaveRecord {
            wave: Wave::Trapezoid,
            kind: "trapezoid",
            text: "low, rise, hold high, fall, hold low",
            parameters: &[
                p("low", "", Some(0.0), "lower level"),
                p("high", "", None, "upper level"),
                p("rise", "s", None, "time of the rise"),
                p("hold_high", "s", Some(0.0), "time at the upper level"),
                p("fall", "s", None, "time of the fall"),
                p("hold_low", "s", Some(0.0), "time at the lower level after the fall"),
                START,
                REPEAT,
                ACCELERATION,
            ],
        },
        WaveRecord {
            wave: Wave::Rectangle,
            kind: "rectangle",
            text: "high for the duty part of each period, then low",
            parameters: &[p("low", "", Some(0.0), "lower level"), p("high", "", None, "upper level"), p("period", "s", None, "period"), p("duty", "1", Some(0.5), "part of the period at the upper level"), START],
        },
        WaveRecord {
            wave: Wave::Table,
            kind: "table",
            text: "points (time, value), linear between them or held; needs times and values",
            parameters: &[START, p("repeat", "1", Some(0.0), "1: starts again after its last point, 0: holds its last value"), p("gain", "1", Some(1.0), "factor on the values"), p("hold", "1", Some(0.0), "1: each value holds until the next point, 0: linear between them")],
        },
    ];
    CATALOGUE
}
