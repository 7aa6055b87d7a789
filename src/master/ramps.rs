//! When RPDO2, the ramps 6083h and 6084h, is sent: on change, and one drive per
//! cycle in turn, so that a drive which lost one gets it again soon.

use crate::motion::AxisCommand;

/// Which axes get their ramps in a cycle.
#[derive(Debug)]
pub struct Ramps<const AXES: usize> {
    /// Acceleration and deceleration as last sent.
    sent: [Option<(u32, u32)>; AXES],
    /// The axis whose turn it is.
    turn: usize,
}

impl<const AXES: usize> Ramps<AXES> {
    /// Nothing was sent yet.
    pub const fn new() -> Ramps<AXES> {
        Ramps {
            sent: [None; AXES],
            turn: 0,
        }
    }

    /// The axes that get RPDO2 in this cycle: those whose ramps changed, and one
    /// more in turn.
    pub fn due(&mut self, commands: &[AxisCommand; AXES]) -> [bool; AXES] {
        let mut due = [false; AXES];
        for ((axis, due), (sent, command)) in due
            .iter_mut()
            .enumerate()
            .zip(self.sent.iter_mut().zip(commands))
        {
            let ramps = Some((command.acceleration, command.deceleration));
            *due = *sent != ramps || axis == self.turn;
            *sent = ramps;
        }
        self.turn = (self.turn + 1) % AXES.max(1);
        due
    }
}

impl<const AXES: usize> Default for Ramps<AXES> {
    fn default() -> Ramps<AXES> {
        Ramps::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn commands(ramps: [(u32, u32); 3]) -> [AxisCommand; 3] {
        ramps.map(|(acceleration, deceleration)| AxisCommand {
            acceleration,
            deceleration,
            ..AxisCommand::default()
        })
    }

    #[test]
    fn all_at_first_then_one_in_turn() {
        let mut ramps = Ramps::new();
        let same = commands([(1, 1); 3]);
        assert_eq!(ramps.due(&same), [true; 3]);
        assert_eq!(ramps.due(&same), [false, true, false]);
        assert_eq!(ramps.due(&same), [false, false, true]);
        assert_eq!(ramps.due(&same), [true, false, false]);
    }

    #[test]
    fn every_change_is_sent_at_once() {
        let mut ramps = Ramps::new();
        ramps.due(&commands([(1, 1); 3]));
        let changed = commands([(1, 2), (1, 1), (2, 1)]);
        assert_eq!(ramps.due(&changed), [true, true, true]);
        assert_eq!(ramps.due(&changed), [false, false, true]);
    }
}
