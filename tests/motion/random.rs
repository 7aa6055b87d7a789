//! Random programs: what the check lets pass keeps every limit in every cycle; and random
//! bytes.

use canmaster::motion::experiment::GROUP;
use canmaster::motion::format;
use canmaster::motion::mode::Mode;
use canmaster::motion::{GroupEvent, GroupState};
use proptest::prelude::*;

use crate::compiled::compiled;
use crate::programs::program;
use crate::rig::{AXES, READY, Rig};

/// Increments per cycle, and per cycle squared, that the axes of the rig may have.
const FASTEST: i32 = 1000;
const STEEPEST: i32 = 67;
/// Positions are whole increments: their differences are off by that.
const ROUNDED: i32 = 1;

/// Runs a program in cyclic synchronous position mode and looks at every set-point.
/// Where the axes are at the end, from home.
fn watched(bytes: Vec<u8>, cycles: u32) -> Result<[i32; AXES], TestCaseError> {
    let mut rig = Rig::in_mode(1, Mode::CyclicPosition);
    rig.program = bytes;
    rig.run();
    let homes: [i32; AXES] = core::array::from_fn(|n| rig.group.view(n).unwrap().home);
    let mut before = [[0; 2]; AXES];
    for known in 0..cycles {
        rig.step(READY);
        for (n, [last, speed]) in before.iter_mut().enumerate() {
            let at = rig.commands[n].target.wrapping_sub(homes[n]);
            let now = at - *last;
            if known > 0 {
                prop_assert!(now.abs() <= FASTEST + ROUNDED, "axis {}: {}", n, now);
            }
            if known > 1 {
                let change = (now - *speed).abs();
                prop_assert!(change <= STEEPEST + 2 * ROUNDED, "axis {}: {}", n, change);
            }
            let (lower, upper) = GROUP.axes[n].travel;
            prop_assert!((lower..=upper).contains(&at));
            (*last, *speed) = (at, now);
        }
        let state = rig.group.state();
        prop_assert!(
            matches!(
                state,
                GroupState::Standby | GroupState::Moving | GroupState::Stopping
            ),
            "{}",
            rig.last()
        );
        if rig.notices.contains(&GroupEvent::ProgramDone) {
            break;
        }
    }
    Ok(before.map(|[last, _]| last))
}

/// One axis' part of a move: reasonable, and now and then not.
fn part() -> impl Strategy<Value = Vec<u8>> {
    let target = prop_oneof![-3000i32..3000, any::<i32>()];
    let velocity = prop_oneof![9 => 300u32..3000, 1 => 0u32..1 << 26];
    let slope = || prop_oneof![9 => 500u32..20_000, 1 => any::<u32>()];
    (target, velocity, slope(), slope()).prop_map(|(target, velocity, up, down)| {
        let numbers = [target as u32, velocity, up, down];
        numbers.into_iter().flat_map(u32::to_le_bytes).collect()
    })
}

fn head(kind: u8, flags: u8, axes: u16, value: u32) -> Vec<u8> {
    let mut bytes = vec![kind, flags];
    bytes.extend(axes.to_le_bytes());
    bytes.extend(value.to_le_bytes());
    bytes
}

fn moves() -> impl Strategy<Value = Vec<u8>> {
    let jerk = prop_oneof![Just(0u32), 10_000u32..1_000_000];
    (0u8..4, 1u16..64, jerk, prop::collection::vec(part(), 6)).prop_map(
        |(flags, axes, jerk, parts)| {
            let mut bytes = head(format::MOVE, flags, axes, jerk);
            for part in parts.iter().take(axes.count_ones() as usize) {
                bytes.extend(part);
            }
            bytes
        },
    )
}

/// A shared shape whose last point is at rest.
fn paths() -> impl Strategy<Value = Vec<u8>> {
    let point = (1u16..40, -1000i32..1000, -60i32..60);
    let points = prop::collection::vec(point, 1..5);
    (1u16..64, 1u32..3, points, -4000i32..4000).prop_map(|(axes, periods, points, amplitude)| {
        let flags = format::RELATIVE | format::SHARED;
        let mut bytes = head(
            format::PATH,
            flags,
            axes,
            points.len() as u32 | periods << 16,
        );
        for _ in 0..axes.count_ones() {
            bytes.extend((amplitude << 10).to_le_bytes());
            bytes.extend([0; 4]);
        }
        let last = points.len() - 1;
        for (n, (cycles, position, velocity)) in points.into_iter().enumerate() {
            let (position, velocity) = match n == last {
                true => (if periods > 1 { 0 } else { position }, 0),
                false => (position, velocity),
            };
            bytes.extend(cycles.to_le_bytes());
            bytes.extend((position << 10).to_le_bytes());
            bytes.extend((velocity << 10).to_le_bytes());
        }
        bytes
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn what_passes_the_check_keeps_the_limits(
        steps in prop::collection::vec(prop_oneof![moves(), paths()], 1..4),
    ) {
        let bytes = program(&steps);
        if format::check(&bytes, &GROUP).is_ok() {
            watched(bytes, 1500)?;
        }
    }

    /// Way-points are reached, whatever they are.
    #[test]
    fn the_last_way_point_is_reached(
        points in prop::collection::vec((-9000i32..9000, -9000i32..9000), 1..6),
        velocity in 100u32..2000,
        acceleration in 300u32..15_000,
    ) {
        let rows: Vec<String> = points.iter().map(|(x, y)| format!("[{x}, {y}]")).collect();
        let text = format!(
            "velocity = {velocity}\nacceleration = {acceleration}\n\
             [[step]]\n[[step.move]]\nto = 0\n[[step]]\n[step.path]\n\
             axes = [\"axis 2\", \"axis 5\"]\npoints = [{}]\n",
            rows.join(", ")
        );
        let ends = watched(compiled(&text).bytes(), 20_000)?;
        let (x, y) = points[points.len() - 1];
        prop_assert_eq!((ends[1], ends[4]), (x, y));
    }
}

proptest! {
    /// Any bytes: an error or not, but no panic, neither in the check nor while
    /// they run.
    #[test]
    fn any_steps_are_checked(steps in prop::collection::vec(any::<u8>(), 0..80)) {
        let bytes = program(&[steps]);
        if format::check(&bytes, &GROUP).is_ok() {
            let mut rig = Rig::standby(1);
            rig.program = bytes;
            rig.run();
            for _ in 0..50 {
                rig.step(READY);
            }
        }
    }

    #[test]
    fn any_bytes_are_checked(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
        let _ = format::check(&bytes, &GROUP);
    }
}
