//! Interrupt lines between peripherals and NVIC, with faults that tests put in.

use std::collections::BTreeMap;

use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rsemu::cpu::arm::v7m::ArmV7m;

/// Interrupt lines that can be told apart.
pub(super) const LINES: usize = 128;

/// A line that is delivered late.
#[derive(Debug)]
struct Delay {
    max_cycles: u64,
    random: Pcg32,
    /// Raised, but not yet delivered: when it will be.
    due: Option<u64>,
}

/// Drives the core's interrupt inputs.
#[derive(Debug)]
pub(super) struct IrqRouter {
    /// What the peripherals drive, and what the core sees.
    wanted: u128,
    driven: u128,
    blocked: u128,
    delays: BTreeMap<u8, Delay>,
    /// Since when each line is high, as the peripheral drives it.
    raised: [u64; LINES],
}

impl IrqRouter {
    pub(super) fn new() -> Self {
        Self {
            wanted: 0,
            driven: 0,
            blocked: 0,
            delays: BTreeMap::new(),
            raised: [0; LINES],
        }
    }

    /// After a reset of core and peripherals all lines are low.
    pub(super) fn reset(&mut self) {
        self.wanted = 0;
        self.driven = 0;
        for delay in self.delays.values_mut() {
            delay.due = None;
        }
    }

    pub(super) fn block(&mut self, irq: u8, blocked: bool) {
        if blocked {
            self.blocked |= bit(irq);
        } else {
            self.blocked &= !bit(irq);
        }
    }

    pub(super) fn delay(&mut self, irq: u8, max_cycles: u64, seed: u64) {
        if max_cycles == 0 {
            self.delays.remove(&irq);
            return;
        }
        let random = Pcg32::seed_from_u64(seed);
        let delay = Delay {
            max_cycles,
            random,
            due: None,
        };
        self.delays.insert(irq, delay);
    }

    /// Takes the levels of the peripherals at `cycle` and drives the core; lines
    /// that rose did so at cycle `raised`. Returns those that the core newly
    /// sees.
    pub(super) fn update(&mut self, levels: u128, cycle: u64, raised: u64, core: &ArmV7m) -> u128 {
        let rising = levels & !self.wanted;
        self.wanted = levels;
        for irq in bits(rising) {
            self.raised[usize::from(irq)] = raised;
        }
        let mut drive = levels & !self.blocked;
        for (&irq, delay) in &mut self.delays {
            if levels & bit(irq) == 0 {
                delay.due = None;
                continue;
            }
            if rising & bit(irq) != 0 {
                let late = delay.random.random_range(0..=delay.max_cycles);
                delay.due = Some(cycle + late);
            }
            match delay.due {
                Some(due) if due > cycle => drive &= !bit(irq),
                _ => delay.due = None,
            }
        }
        let changed = drive ^ self.driven;
        let up = changed & drive;
        for irq in bits(changed) {
            core.set_irq(u16::from(irq), drive & bit(irq) != 0);
        }
        self.driven = drive;
        up
    }

    /// When a delayed line is to be delivered next.
    pub(super) fn next_delivery(&self) -> u64 {
        let due = self.delays.values().filter_map(|delay| delay.due).min();
        due.unwrap_or(u64::MAX)
    }

    /// Since when a line has been high, if it is.
    pub(super) fn raised_at(&self, irq: u8) -> Option<u64> {
        (self.wanted & bit(irq) != 0).then(|| self.raised[usize::from(irq)])
    }

    /// The handler of a line that is still high has returned: it pends again.
    pub(super) fn served(&mut self, irq: u8, cycle: u64) {
        if let Some(raised) = self.raised.get_mut(usize::from(irq)) {
            *raised = cycle;
        }
    }

    /// Lines that the core sees high.
    pub(super) const fn driven(&self) -> u128 {
        self.driven
    }
}

const fn bit(irq: u8) -> u128 {
    1u128.wrapping_shl(irq as u32)
}

/// The numbers of the set bits.
pub(super) fn bits(mut set: u128) -> impl Iterator<Item = u8> {
    std::iter::from_fn(move || {
        if set == 0 {
            return None;
        }
        let irq = set.trailing_zeros() as u8;
        set &= set - 1;
        Some(irq)
    })
}
