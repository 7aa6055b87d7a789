//! The programs that a client downloads before the fault: some of `programs/`, and a
//! tour through the modes.

use crate::world::Machine;

/// Each with a name for a table.
pub(super) const PROGRAMS: [(&str, &str); 4] = [
    ("tour of the modes", TOUR),
    ("homing", include_str!("../../../../programs/homing.toml")),
    ("sine", include_str!("../../../../programs/sine.toml")),
    (
        "six axes",
        include_str!("../../../../programs/six_axes.toml"),
    ),
];

/// Short moves of all axes in one mode after the other.
const TOUR: &str = r#"
name = "tour of the modes"
unit = "turns"
velocity = 1200
acceleration = 3000

[[step]]
forever = true
[[step.step]]
[step.step.mode]
is = "cyclic synchronous position"
[[step.step]]
[[step.step.move]]
by = 4
[[step.step]]
[step.step.mode]
is = "profile position"
[[step.step]]
[[step.step.move]]
by = -4
[[step.step]]
[step.step.mode]
is = "cyclic synchronous velocity"
[[step.step]]
[[step.step.move]]
by = 3
[[step.step]]
[step.step.mode]
is = "profile velocity"
[[step.step]]
[[step.step.move]]
by = -3
"#;

/// The bytes of a program for a machine.
///
/// # Panics
/// If the machine cannot run it: all of them are made for any machine of six axes.
pub(super) fn compiled(machine: &Machine, program: usize) -> Vec<u8> {
    let (name, text) = PROGRAMS[program];
    let made = machine.program(name, text);
    made.unwrap_or_else(|problems| panic!("{problems}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::sample;

    #[test]
    fn the_sample_can_run_all_of_them() {
        for program in 0..PROGRAMS.len() {
            assert!(!compiled(sample(), program).is_empty());
        }
    }
}
