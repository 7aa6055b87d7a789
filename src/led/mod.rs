//! Indicator LEDs (CiA 303-3).
//!
//! All patterns are read off one clock, so that the two LEDs of a device (and
//! of several devices on one clock) keep step: blinking and flickering red and
//! green alternate.

use crate::nmt::State;
use crate::time::{Duration, Instant};

/// Which LED (CiA 303-3, 4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Colour {
    /// RUN.
    Green,
    /// ERR.
    Red,
}

/// How an LED is lit (CiA 303-3, 4.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Pattern {
    /// Dark.
    Off,
    /// Lit.
    On,
    /// 10 Hz, 50 ms each.
    Flickering,
    /// 2.5 Hz, 200 ms each.
    Blinking,
    /// So many flashes of 200 ms, 200 ms apart, then 1000 ms dark.
    Flashes(u8),
}

/// Half a period of flickering.
const FLICKER: Duration = Duration::from_millis(50);
/// Half a period of blinking, a flash, and the gap between flashes.
const BLINK: Duration = Duration::from_millis(200);
/// The dark time after the last flash.
const PAUSE: Duration = Duration::from_millis(1000);
const PAUSE_SLOTS: u32 = PAUSE.as_micros() / BLINK.as_micros();

impl Pattern {
    /// After which the pattern repeats; zero for on and off.
    pub const fn period(self) -> Duration {
        match self {
            Pattern::Off | Pattern::On => Duration::ZERO,
            Pattern::Flickering => Duration::from_micros(2 * FLICKER.as_micros()),
            Pattern::Blinking => Duration::from_micros(2 * BLINK.as_micros()),
            Pattern::Flashes(count) => Duration::from_micros(
                BLINK.as_micros() * (2 * count as u32).saturating_sub(1) + PAUSE.as_micros(),
            ),
        }
    }

    /// Whether the LED is lit at `now`.
    pub const fn is_on(self, colour: Colour, now: Instant) -> bool {
        // In slots as long as a flash: how many there are, and where the flashes end.
        let (length, slots, end) = match self {
            Pattern::Off => (BLINK, 1, 0),
            Pattern::On => (BLINK, 1, 1),
            Pattern::Flickering => (FLICKER, 2, 2),
            Pattern::Blinking => (BLINK, 2, 2),
            Pattern::Flashes(count) => {
                (BLINK, 2 * count as u32 + PAUSE_SLOTS - 1, 2 * count as u32)
            }
        };
        // The lower half of the clock is enough: once in 71 minutes, when it starts
        // again, one flash is cut short.
        let slot = now.as_micros() as u32 / length.as_micros() % slots;
        // Red is lit when green is not, where half of the slots are.
        let first = matches!((colour, slots), (Colour::Red, 2)) as u32;
        slot < end && slot % 2 == first
    }
}

/// What the RUN LED shows (CiA 303-3, 4.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Run {
    /// The NMT state.
    Nmt(State),
    /// A program is being downloaded.
    Download,
    /// LSS services are under way, or the bit rate is being detected.
    Lss,
}

impl Run {
    /// The pattern of the green LED.
    pub const fn pattern(self) -> Pattern {
        match self {
            Run::Nmt(State::Operational) => Pattern::On,
            Run::Nmt(State::PreOperational) => Pattern::Blinking,
            Run::Nmt(State::Stopped) => Pattern::Flashes(1),
            Run::Nmt(State::Initialising | State::Other(_)) => Pattern::Off,
            Run::Download => Pattern::Flashes(3),
            Run::Lss => Pattern::Flickering,
        }
    }
}

/// What is wrong, for the ERR LED (CiA 303-3, 4.3). Several can be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Errors {
    /// The CAN controller is bus-off.
    pub bus_off: bool,
    /// The device is not initialised or has no node-ID.
    pub not_initialised: bool,
    /// An RPDO did not arrive within its event timer.
    pub event_timer: bool,
    /// No SYNC within the communication cycle period.
    pub sync: bool,
    /// A heartbeat or guarding was lost.
    pub error_control: bool,
    /// A CAN error counter has reached its warning limit.
    pub warning_limit: bool,
    /// The configuration is invalid, or another error of the device.
    pub configuration: bool,
}

impl Errors {
    /// The pattern of the red LED: that of the worst error.
    pub const fn pattern(&self) -> Pattern {
        if self.bus_off {
            Pattern::On
        } else if self.not_initialised {
            Pattern::Flickering
        } else if self.event_timer {
            Pattern::Flashes(4)
        } else if self.sync {
            Pattern::Flashes(3)
        } else if self.error_control {
            Pattern::Flashes(2)
        } else if self.warning_limit {
            Pattern::Flashes(1)
        } else if self.configuration {
            Pattern::Blinking
        } else {
            Pattern::Off
        }
    }
}
