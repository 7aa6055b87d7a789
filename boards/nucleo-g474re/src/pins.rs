//! Pins: CAN, LEDs, button.

use stm32g4xx_hal::gpio::{self, Input, Output, PA5, PB0, PC13, PinState, Speed};

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
    pub(crate) run_led: RunLed,
    pub(crate) error_led: ErrorLed,
    pub(crate) button: Button,
}

/// `CAN`: a bit for each controller that is used.
pub(crate) fn setup<const CAN: u8>(
    a: gpio::gpioa::Parts,
    b: gpio::gpiob::Parts,
    c: gpio::gpioc::Parts,
) -> Pins {
    // A bit is 1 us: the edges of the fast setting are far inside it.
    if uses(CAN, 0) {
        a.pa11.into_alternate::<9>();
        a.pa12.into_alternate::<9>().speed(Speed::High);
    }
    if uses(CAN, 1) {
        b.pb12.into_alternate::<9>();
        b.pb13.into_alternate::<9>().speed(Speed::High);
    }
    if uses(CAN, 2) {
        a.pa8.into_alternate::<11>();
        // JTDI after a reset; SWD does not need it.
        a.pa15.into_alternate::<11>().speed(Speed::High);
    }
    Pins {
        run_led: RunLed(a.pa5.into_push_pull_output()),
        error_led: ErrorLed(b.pb0.into_push_pull_output()),
        button: Button(c.pc13.into_floating_input()),
    }
}

/// Whether the controller `index` is among those of the bits of `can`.
pub(crate) const fn uses(can: u8, index: u8) -> bool {
    can & 1 << index != 0
}
