//! C interface of the core: one run that is made from a resolved document, stepped, read and changed by numbers, kept as
//! bytes. The functions of FMI 2.0 and 3.0 are in the same library: it is the binary of every exported FMU.

pub mod c;
pub mod fmi;
mod json;
mod run;
mod spec;
mod text;

pub use run::{Fault, Run, Verdict};
pub use spec::{Kind, Spec, Variable};
