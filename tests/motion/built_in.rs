//! The program that is built into the image: the experiment in pairs.

use canmaster::motion::experiment::{GROUP, PROGRAM};
use canmaster::motion::{GroupEvent, GroupState, Program, format};

use crate::rig::{AXES, CYCLE_MS, READY, Rig};

const BYTES: usize = Program::<AXES>::len_of(2, 1);

#[test]
fn its_bytes_pass_the_check() {
    let bytes: [u8; BYTES] = PROGRAM.bytes();
    assert_eq!(format::check(&bytes, &GROUP), Ok(()));
    let short: [u8; BYTES - 1] = PROGRAM.bytes();
    assert!(format::check(&short, &GROUP).is_err());
}

/// One release runs it, as long as it says.
#[test]
fn it_takes_as_long_as_it_says() {
    let mut rig = Rig::standby(2);
    rig.program = PROGRAM.bytes::<BYTES>().to_vec();
    rig.run();
    let start = rig.cycle;
    rig.step(READY);
    rig.until(GroupState::Standby, 1000);
    let took = f64::from(rig.cycle - start) * CYCLE_MS;
    let expected = f64::from(PROGRAM.duration(&GROUP).unwrap().as_millis());
    assert!(
        (took - expected).abs() < 0.02 * expected,
        "{took} {expected}"
    );
    let steps = rig
        .notices
        .iter()
        .filter(|event| matches!(event, GroupEvent::StepStarted { .. }));
    assert_eq!(steps.count(), 3);
    assert!(rig.standing());
}
