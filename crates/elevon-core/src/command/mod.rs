//! Waveforms: commands, loads and the supply are sums of them.
//!
//! A sum is compiled to one parabola (all piecewise linear and rounded terms together) plus a list of
//! oscillators (sine, chirp); the parabola is renewed at breakpoints, which are events of the
//! solver. So the inner loop pays for a parabola and the sines, whatever the sum holds.

mod rounded;
mod source;
mod term;
mod wave;

pub use source::{Source, SourceLanes, SourcePlan};
pub use term::Term;
pub use wave::{catalogue, Wave, WaveRecord};
