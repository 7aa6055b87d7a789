//! When RPDO2, the ramps 6083h and 6084h, is sent: on change, one drive per cycle;
//! and now and then again, for a drive that was started anew meanwhile.

use crate::motion::AxisCommand;

/// Which axis gets its ramps in a cycle.
#[derive(Debug)]
pub struct Ramps<const AXES: usize> {
    /// Acceleration and deceleration as last sent; 0 is none that a drive takes.
    sent: [(u32, u32); AXES],
    /// The axis that was last.
    turn: usize,
    /// Cycles since.
    idle: u8,
}

impl<const AXES: usize> Ramps<AXES> {
    /// Nothing was sent yet.
    pub const fn new() -> Ramps<AXES> {
        Ramps {
            sent: [(0, 0); AXES],
            turn: 0,
            idle: 0,
        }
    }

    /// The axis that gets RPDO2 in this cycle: the next whose ramps changed. If
    /// none did, one in turn every [`RAMPS_AGAIN`] cycles.
    pub fn due(&mut self, commands: &[AxisCommand; AXES]) -> Option<usize> {
        self.idle = self.idle.wrapping_add(1);
        for _ in 0..AXES {
            self.turn = (self.turn + 1) % AXES.max(1);
            let (Some(command), Some(sent)) =
                (commands.get(self.turn), self.sent.get_mut(self.turn))
            else {
                return None;
            };
            let ramps = (command.acceleration, command.deceleration);
            if *sent != ramps || self.idle >= RAMPS_AGAIN {
                *sent = ramps;
                self.idle = 0;
                return Some(self.turn);
            }
        }
        None
    }
}

/// Cycles without a change after which ramps are sent again.
pub const RAMPS_AGAIN: u8 = 16;

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
    fn every_change_is_sent_one_in_a_cycle() {
        let mut ramps = Ramps::new();
        let same = commands([(1, 1); 3]);
        assert_eq!(ramps.due(&same), Some(1));
        assert_eq!(ramps.due(&same), Some(2));
        assert_eq!(ramps.due(&same), Some(0));
        assert_eq!(ramps.due(&same), None);
        let changed = commands([(1, 2), (1, 1), (2, 1)]);
        assert_eq!(ramps.due(&changed), Some(2));
        assert_eq!(ramps.due(&changed), Some(0));
        assert_eq!(ramps.due(&changed), None);
    }

    #[test]
    fn all_are_sent_again_in_the_long_run() {
        let mut ramps = Ramps::new();
        let same = commands([(1, 1); 3]);
        let sent: std::vec::Vec<_> = (0..100).filter_map(|_| ramps.due(&same)).collect();
        assert_eq!(sent, [1, 2, 0, 1, 2, 0, 1, 2, 0]);
    }
}
