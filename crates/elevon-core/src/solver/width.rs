//! The vector width of batches, chosen at run time.

use crate::scalar::fused;

/// Lane types that a processor can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    Single,
    Portable,
    Avx2,
    Avx512,
}

impl Width {
    /// The widest of this processor.
    pub fn detect() -> Self {
        if cfg!(feature = "physics") {
            return Self::Single;
        }
        #[cfg(target_arch = "x86_64")]
        {
            let wide = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") && is_x86_feature_detected!("avx512vl");
            if wide && fused() {
                return Self::Avx512;
            }
            if fused() && !cfg!(feature = "widest") {
                return Self::Avx2;
            }
        }
        if cfg!(feature = "widest") {
            Self::Single
        } else {
            Self::Portable
        }
    }

    /// Of a run by itself: where `f64` is not compiled for the processor, the portable lanes, with the same bits.
    pub fn alone() -> Self {
        if fused() || cfg!(any(feature = "physics", feature = "widest")) {
            Self::Single
        } else {
            Self::Portable
        }
    }

    /// For so many runs: lanes gain a lone one nothing.
    pub(super) fn of(self, runs: usize) -> Self {
        if runs == 1 || self == Self::Single {
            Self::alone()
        } else {
            self
        }
    }

    pub const NAMES: [&'static str; 4] = ["single", "portable", "avx2", "avx512"];

    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// By name, if this processor can run it; `auto` is the widest.
    pub fn by_name(name: &str) -> Option<Self> {
        let widest = Self::detect();
        let width = match name {
            "auto" => return Some(widest),
            "single" => Self::Single,
            "portable" => Self::Portable,
            "avx2" => Self::Avx2,
            "avx512" => Self::Avx512,
            _ => return None,
        };
        let built = width == Self::Single || width == widest || !cfg!(feature = "widest");
        (built && width as usize <= widest as usize).then_some(width)
    }

    pub fn lanes(self) -> usize {
        match self {
            Self::Single => 1,
            Self::Portable => 2,
            Self::Avx2 => 4,
            Self::Avx512 => 8,
        }
    }
}

/// `$body` with `$lanes` as the scalar of a width. A build for work on physics knows single runs only, one for work on speed
/// those and the widest lanes (`Width::detect`).
macro_rules! with_lanes {
    ($width:expr, $lanes:ident => $body:expr) => {
        match $width {
            #[cfg(not(any(feature = "physics", feature = "widest")))]
            $crate::solver::Width::Portable => {
                type $lanes = $crate::scalar::Portable;
                $body
            }
            #[cfg(all(target_arch = "x86_64", not(any(feature = "physics", feature = "widest"))))]
            $crate::solver::Width::Avx2 => {
                type $lanes = $crate::scalar::Avx2x4;
                $body
            }
            #[cfg(all(target_arch = "x86_64", not(feature = "physics")))]
            $crate::solver::Width::Avx512 => {
                type $lanes = $crate::scalar::Avx512x8;
                $body
            }
            _ => {
                type $lanes = f64;
                $body
            }
        }
    };
}

pub(super) use with_lanes;
