//! Pins: CAN, LEDs, button.

use stm32g4xx_hal::gpio::{self, AF9, Input, Output, PA5, PA11, PA12, PB0, PC13, PinState, Speed};

/// LD2 on PA5, green, lit by a high level.
pub struct RunLed(PA5<Output>);

/// A red LED with its resistor between PB0 (Arduino A3, CN8-4) and ground, lit
/// by a high level. The board itself has none to spare.
pub struct ErrorLed(PB0<Output>);

/// B1 on PC13: pressed is high (the board pulls the pin down).
pub struct Button(PC13<Input>);

impl RunLed {
    /// Switches the LED.
    pub fn set(&mut self, on: bool) {
        self.0.set_state(PinState::from(on));
    }
}

impl ErrorLed {
    /// Switches the LED.
    pub fn set(&mut self, on: bool) {
        self.0.set_state(PinState::from(on));
    }
}

impl Button {
    /// The contact as it is now, bouncing included.
    pub fn is_pressed(&self) -> bool {
        self.0.is_high()
    }
}

pub(crate) struct Pins {
    pub(crate) can_rx: PA11<AF9>,
    pub(crate) can_tx: PA12<AF9>,
    pub(crate) run_led: RunLed,
    pub(crate) error_led: ErrorLed,
    pub(crate) button: Button,
}

pub(crate) fn setup(a: gpio::gpioa::Parts, b: gpio::gpiob::Parts, c: gpio::gpioc::Parts) -> Pins {
    Pins {
        can_rx: a.pa11.into_alternate(),
        // A bit is 1 us: the edges of the fast setting are far inside it.
        can_tx: a.pa12.into_alternate().speed(Speed::High),
        run_led: RunLed(a.pa5.into_push_pull_output()),
        error_led: ErrorLed(b.pb0.into_push_pull_output()),
        button: Button(c.pc13.into_floating_input()),
    }
}
