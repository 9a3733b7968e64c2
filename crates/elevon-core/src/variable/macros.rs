//! Declarations in one place: parameters and their records, choices and their names, groups and where each begins.

/// Declares an enum of parameters and the table of their records, in one place.
#[macro_export]
macro_rules! variables {
    ($(#[$meta:meta])* $id:ident, $table:ident {
        $($variant:ident => $path:literal, $symbol:literal, $unit:literal, $range:expr, $register:ident, $default:expr, $text:literal $(, $acts:expr)?;)*
    }) => {
        $(#[$meta])*
        // Rows of one kind are reached by counting from the first: not every name is written out.
        #[allow(dead_code)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        pub enum $id { $($variant),* }
        $(const _: () = assert!($crate::variable::named(stringify!($variant), $path), concat!("the variant of ", $path, " carries its name"));)*
        impl $crate::variable::Parameter for $id {
            const TABLE: &'static [$crate::variable::Variable] = $table;
            fn index(self) -> usize {
                self as usize
            }
        }
        pub const $table: &[$crate::variable::Variable] = {
            #[allow(unused_imports)]
            use $crate::variable::{acts::{Fidelity::*, When::*, *}, Range::{self, *}};
            const fn or_always(given: &[Acts]) -> Acts {
                if given.is_empty() { ALWAYS } else { given[0] }
            }
            &[$($crate::variable::Variable {
                path: $path, symbol: $symbol, unit: $unit, range: $range,
                register: $crate::variable::Register::$register, default: $default, text: $text, acts: or_always(&[$($acts)?]),
            }),*]
        };
    };
}

/// Declares an enum of signals and the table of their records.
#[macro_export]
macro_rules! signals {
    ($(#[$meta:meta])* $id:ident, $table:ident {
        $($variant:ident => $name:literal, $symbol:literal, $unit:literal, $text:literal $(, $role:ident)?;)*
    }) => {
        $(#[$meta])*
        // Phases b and c are reached by counting from a: not every name is written out.
        #[allow(dead_code)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        pub enum $id { $($variant),* }
        pub const $table: &[$crate::variable::Signal] = &[$($crate::variable::Signal {
            name: $name, symbol: $symbol, unit: $unit, text: $text,
            role: $crate::variable::role::only(&[$($crate::variable::Role::$role)?]),
        }),*];
    };
}

/// Declares the enum and the table of signals whose records stand in the table of another enum; with a text of its own where one
/// is given.
#[macro_export]
macro_rules! signals_of {
    ($(#[$meta:meta])* $id:ident, $table:ident of $from:ident, $records:ident { $($variant:ident $(: $text:literal)?;)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        pub enum $id { $($variant),* }
        pub const $table: &[$crate::variable::Signal] =
            &[$($records[$from::$variant as usize].reworded(concat!("" $(, $text)?))),*];
    };
}

/// Declares the enums of parameters that are choices: their names in the order of their indices, and the enum itself.
#[macro_export]
macro_rules! choices {
    ($($(#[$meta:meta])* $id:ident { $($variant:ident $name:literal),* $(,)? })*) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum $id { $($variant),* }
        // Not every choice is looked up both by name and by index.
        #[allow(dead_code)]
        impl $id {
            pub const NAMES: &'static [&'static str] = &[$($name),*];
            const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The choice that a parameter holds as its index; runs of a block share their choices.
            #[inline(always)]
            pub fn read<S: $crate::scalar::Scalar>(raw: S) -> Self {
                Self::ALL[(raw.lane(0) as usize).min(Self::ALL.len() - 1)]
            }
            /// The index as a parameter holds it.
            pub const fn index(self) -> f64 {
                self as u8 as f64
            }
        }
    )*};
}

/// Declares the details of a run: what decides which code runs, equal over a lane block. Each is a line: the name and the
/// condition under which a run needs it. `full` and `extra` follow from the lines: no detail can be forgotten in them.
#[macro_export]
macro_rules! details {
    (
        $(#[$meta:meta])* $id:ident, $read:ident<$form:ident>($x:ident: $from:ty)
        always { $($(#[$ameta:meta])* $always:ident: $kind:ty = $value:expr;)* }
        full { $($(#[$fmeta:meta])* $full:ident = $needed:expr;)* }
        extra { $($(#[$emeta:meta])* $extra:ident = $wanted:expr;)* }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct $id {
            $($(#[$ameta])* pub $always: $kind,)*
            $($(#[$fmeta])* pub $full: bool,)*
            $($(#[$emeta])* pub $extra: bool,)*
            /// Some optional detail is there.
            pub full: bool,
            /// Some detail is there that only some servos have.
            pub extra: bool,
        }

        impl $id {
            // Not every part depends on the form.
            #[allow(clippy::extra_unused_type_parameters)]
            pub(in $crate::actuator::servo) fn $read<$form: Form>($x: $from) -> Self {
                $(let $always: $kind = $value;)*
                $(let $full: bool = $needed;)*
                $(let $extra: bool = $wanted;)*
                let extra = false $(|| $extra)*;
                let full = extra $(|| $full)*;
                Self { $($always,)* $($full,)* $($extra,)* full, extra }
            }
        }
    };
}

/// Declares the groups of a wiring in the order of its parameter vector: `GROUPS`, a view of the vector by component, and
/// where each parameter stands in it (`At`). With `over`, the groups of another layout (some with other names and units,
/// none with other lengths) and further ones behind them.
#[macro_export]
macro_rules! groups {
    ($($view:ident: $prefix:literal, $table:expr, $id:ident;)*) => {
        pub const GROUPS: &[$crate::variable::Group] = &[$($crate::variable::group($prefix, $table)),*];

        /// The groups by their view's name.
        #[allow(non_camel_case_types, dead_code)]
        #[derive(Clone, Copy)]
        pub enum Part { $($view),* }

        /// A view of the parameter vector by component.
        #[derive(Clone, Copy)]
        pub struct Raw<'a, S>(pub &'a [S]);

        // Some components are read by single numbers only.
        #[allow(dead_code)]
        impl<'a, S> Raw<'a, S> {
            $(pub fn $view(self) -> &'a [S] {
                $crate::variable::slice(GROUPS, Part::$view as usize, self.0)
            })*
        }

        /// The parameters of each component in a run, and which of them faults move.
        #[derive(Clone, Copy)]
        pub struct Parts<'a>(pub &'a $crate::actuator::Setup<'a>);

        // Some components are always there.
        #[allow(dead_code)]
        impl<'a> Parts<'a> {
            $(pub fn $view(self) -> $crate::variable::View<'a, $id> {
                $crate::variable::View::new(Raw(self.0.raw).$view(), Raw(self.0.touched).$view())
            })*
        }

        /// Index in the whole parameter vector.
        pub trait At {
            fn at(self) -> usize;
        }
        $(impl At for $id {
            #[inline(always)]
            fn at(self) -> usize {
                const BEGIN: usize = $crate::variable::offset(GROUPS, Part::$view as usize);
                BEGIN + self as usize
            }
        })*
    };
    (over $base:ident { $($view:ident: $table:expr;)* } $($more:ident: $prefix:literal, $further:expr, $id:ident;)*) => {
        /// The further groups by their view's name.
        #[allow(non_camel_case_types, dead_code)]
        #[derive(Clone, Copy)]
        pub enum Part { $($more),* }

        pub const GROUPS: &[$crate::variable::Group] = &{
            const FURTHER: &[$crate::variable::Group] = &[$($crate::variable::group($prefix, $further)),*];
            let mut all = $crate::variable::followed::<{ $base::GROUPS.len() + FURTHER.len() }>($base::GROUPS, FURTHER);
            $(
                assert!($table.len() == all[$base::Part::$view as usize].variables.len());
                all[$base::Part::$view as usize].variables = $table;
            )*
            all
        };

        /// The further components in a run, and which of their parameters faults move.
        #[derive(Clone, Copy)]
        pub struct Parts<'a>(pub &'a $crate::actuator::Setup<'a>);

        // Some components are always there.
        #[allow(dead_code)]
        impl<'a> Parts<'a> {
            $(pub fn $more(self) -> $crate::variable::View<'a, $id> {
                $crate::variable::View::new($more(self.0.raw), $more(self.0.touched))
            })*
        }

        $(
            #[doc = concat!("The parameters of the group `", $prefix, "`.")]
            #[allow(dead_code)]
            pub fn $more<S>(raw: &[S]) -> &[S] {
                $crate::variable::slice(GROUPS, $base::GROUPS.len() + Part::$more as usize, raw)
            }
            impl $base::At for $id {
                #[inline(always)]
                fn at(self) -> usize {
                    const BEGIN: usize = $crate::variable::offset(GROUPS, $base::GROUPS.len() + Part::$more as usize);
                    BEGIN + self as usize
                }
            }
        )*
    };
}
