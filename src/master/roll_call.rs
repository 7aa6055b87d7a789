//! The roll call: the watchdog is fed only when every task has shown up.

use core::sync::atomic::{AtomicU32, Ordering};

/// Tasks check in by number; one task asks whether all have.
#[derive(Debug)]
pub struct RollCall {
    missing: AtomicU32,
    all: u32,
}

impl RollCall {
    /// A roll call of the tasks `0..tasks`, at most 32; nobody has shown up yet.
    pub const fn new(tasks: u32) -> RollCall {
        let all = if tasks >= u32::BITS {
            u32::MAX
        } else {
            (1 << tasks) - 1
        };
        RollCall {
            missing: AtomicU32::new(all),
            all,
        }
    }

    /// `task` is alive. From any priority; a number out of range is ignored.
    #[inline]
    pub fn check_in(&self, task: u32) {
        let bit = 1_u32.checked_shl(task).unwrap_or(0);
        // Almost always it has been here before.
        if self.missing.load(Ordering::Relaxed) & bit != 0 {
            self.missing.fetch_and(!bit, Ordering::Relaxed);
        }
    }

    /// Whether all have checked in since the last `true`. If so, the next round
    /// begins.
    pub fn complete(&self) -> bool {
        if self.missing.load(Ordering::Relaxed) != 0 {
            return false;
        }
        self.missing.store(self.all, Ordering::Relaxed);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complete_only_when_everybody_is_there() {
        let roll = RollCall::new(3);
        for _ in 0..2 {
            assert!(!roll.complete());
            roll.check_in(0);
            roll.check_in(2);
            roll.check_in(2);
            assert!(!roll.complete());
            roll.check_in(1);
            assert!(roll.complete());
        }
    }

    #[test]
    fn strangers_do_not_count() {
        let roll = RollCall::new(2);
        roll.check_in(0);
        roll.check_in(7);
        roll.check_in(40);
        assert!(!roll.complete());
    }

    #[test]
    fn thirty_two_tasks() {
        let roll = RollCall::new(32);
        for task in 0..32 {
            assert!(!roll.complete());
            roll.check_in(task);
        }
        assert!(roll.complete());
    }
}
