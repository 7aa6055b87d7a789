//! What the two LEDs show (CiA 303-3).

use crate::control::Control;
use canmaster::{
    led::{Colour, Errors, Run},
    time::Instant,
};
use nucleo_g474re::can::ErrorState;

/// Whether the RUN LED is lit at `now`.
pub(crate) fn run(control: &Control, now: Instant) -> bool {
    Run::Nmt(control.state())
        .pattern()
        .is_on(Colour::Green, now)
}

/// Whether the ERR LED is lit at `now`.
pub(crate) fn error(control: &Control, bus: ErrorState, node_lost: bool, now: Instant) -> bool {
    let errors = Errors {
        bus_off: control.bus_off,
        error_control: node_lost || control.node_missing,
        warning_limit: bus != ErrorState::Active,
        configuration: control.boot_failed,
        ..Errors::default()
    };
    errors.pattern().is_on(Colour::Red, now)
}
