//! A debounced push-button.

/// Reports a press once the contact has been closed for a number of samples in
/// a row.
///
/// It starts out as pressed, so that a button held or stuck at power-on starts
/// nothing: it has to be let go first.
#[derive(Clone, Copy, Debug)]
pub struct Debounce {
    samples: u8,
    /// How many samples in a row differ from `pressed`.
    differing: u8,
    pressed: bool,
}

impl Debounce {
    /// A change counts after `samples` equal samples.
    pub const fn new(samples: u8) -> Debounce {
        Debounce {
            samples,
            differing: 0,
            pressed: true,
        }
    }

    /// Takes in a sample; `true` at the moment of a press.
    pub fn press(&mut self, closed: bool) -> bool {
        if closed == self.pressed {
            self.differing = 0;
            return false;
        }
        self.differing = self.differing.saturating_add(1);
        if self.differing < self.samples {
            return false;
        }
        self.pressed = closed;
        self.differing = 0;
        closed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn presses(button: &mut Debounce, samples: &[(bool, usize)]) -> usize {
        let mut count = 0;
        for (closed, times) in samples {
            for _ in 0..*times {
                count += usize::from(button.press(*closed));
            }
        }
        count
    }

    #[test]
    fn a_bouncing_press_is_one_press() {
        let mut button = Debounce::new(20);
        assert_eq!(presses(&mut button, &[(false, 20)]), 0);
        let bouncing = [(true, 3), (false, 1), (true, 5), (false, 2), (true, 60)];
        assert_eq!(presses(&mut button, &bouncing), 1);
        assert_eq!(presses(&mut button, &[(false, 4), (true, 100)]), 0);
        assert_eq!(presses(&mut button, &[(false, 20), (true, 20)]), 1);
    }

    #[test]
    fn a_spike_is_none() {
        let mut button = Debounce::new(20);
        assert_eq!(
            presses(&mut button, &[(false, 50), (true, 19), (false, 50)]),
            0
        );
    }

    #[test]
    fn a_button_held_at_power_on_has_to_be_let_go_first() {
        let mut button = Debounce::new(20);
        assert_eq!(presses(&mut button, &[(true, 1000)]), 0);
        assert_eq!(presses(&mut button, &[(false, 20), (true, 20)]), 1);
    }
}
