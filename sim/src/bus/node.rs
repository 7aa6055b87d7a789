//! One node: its controller on its own bit grid (ISO 11898-1:2015, 11.3).

use super::controller::{Controller, Io, RECESSIVE};
use super::types::{BitTiming, Event, Offer, PortId};

const PERMILLE: u64 = 1000;

#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) name: String,
    pub(super) timing: Option<BitTiming>,
    pub(super) controller: Controller,
    pub(super) offer: Option<Offer>,
    /// Length of a bit, of its part before the sample point, and of the
    /// longest correction, in picoseconds.
    pub(super) bit: u64,
    pub(super) sample: u64,
    sjw: u64,
    /// Where the running bit began, corrections included.
    pub(super) bit_start: u64,
    /// Whether its sample point has passed.
    pub(super) sampled: bool,
    /// The level at the last sample point.
    last_level: bool,
    /// Only one correction between two sample points.
    corrected: bool,
    /// The level that it sees now.
    pub(super) sees: bool,
}

/// What a node does next on its own grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Step {
    BeginBit,
    Sample,
}

impl Node {
    pub(super) fn new(name: &str) -> Node {
        Node {
            name: name.to_owned(),
            timing: None,
            controller: Controller::new(),
            offer: None,
            bit: 0,
            sample: 0,
            sjw: 0,
            bit_start: 0,
            sampled: false,
            last_level: RECESSIVE,
            corrected: false,
            sees: RECESSIVE,
        }
    }

    /// Leaves the bus, or joins it anew with this timing.
    pub(super) fn set_timing(&mut self, timing: Option<BitTiming>, now: u64) {
        self.timing = timing;
        let Some(timing) = timing else {
            self.controller.switch_off();
            self.offer = None;
            return;
        };
        // A bit of less than a permille's resolution is no bit.
        self.bit = timing.bit_time_ps.max(PERMILLE);
        let part = |permille: u16| self.bit * u64::from(permille).min(PERMILLE) / PERMILLE;
        self.sample = part(timing.sample_point_permille).clamp(1, self.bit - 1);
        self.sjw = part(timing.sjw_permille)
            .min(self.sample)
            .min(self.bit - self.sample);
        self.bit_start = now;
        self.sampled = false;
        self.last_level = RECESSIVE;
        self.corrected = false;
        self.controller.switch_on();
    }

    /// When its next step is due, and which.
    pub(super) fn next_step(&self) -> (u64, Step) {
        if self.sampled {
            (self.bit_start + self.bit, Step::BeginBit)
        } else {
            (self.bit_start + self.sample, Step::Sample)
        }
    }

    /// The first bit boundary of the idle node at or after `from`.
    pub(super) fn boundary_from(&self, from: u64) -> u64 {
        let bits = from.saturating_sub(self.bit_start).div_ceil(self.bit);
        self.bit_start + bits.max(1) * self.bit
    }

    /// Makes up for the bits that an idle node was not stepped through: the
    /// running bit is the one that ends at or after `now`.
    pub(super) fn catch_up(&mut self, now: u64) {
        let bits = now.saturating_sub(self.bit_start + 1) / self.bit;
        if bits > 0 {
            self.bit_start += bits * self.bit;
            self.corrected = false;
        }
        self.sampled = self.bit_start + self.sample < now;
        self.last_level = RECESSIVE;
    }

    /// The node is in the third bit of the intermission, past its sample
    /// point, after an undisturbed frame that it followed.
    pub(super) fn settle(&mut self, bit_start: u64) {
        self.bit_start = bit_start;
        self.sampled = true;
        self.last_level = RECESSIVE;
        self.corrected = false;
    }

    /// A bit boundary of its own grid.
    pub(super) fn begin_bit(&mut self, port: usize, now: u64, out: &mut Vec<Event>) {
        self.bit_start = now;
        self.sampled = false;
        let mut io = Io {
            now,
            bit_start: now,
            port: PortId(port),
            offer: &mut self.offer,
            out,
        };
        self.controller.begin_bit(&mut io);
    }

    /// The sample point.
    pub(super) fn take_sample(&mut self, port: usize, now: u64, level: bool, out: &mut Vec<Event>) {
        self.sampled = true;
        self.corrected = false;
        self.last_level = level;
        let mut io = Io {
            now,
            bit_start: self.bit_start,
            port: PortId(port),
            offer: &mut self.offer,
            out,
        };
        self.controller.sample(level, &mut io);
    }

    /// The bus turned dominant. True if the node's next bit begins with this
    /// edge.
    pub(super) fn edge(&mut self, now: u64) -> bool {
        if self.last_level != RECESSIVE {
            return false;
        }
        if self.controller.takes_hard_sync() {
            self.corrected = true;
            return true;
        }
        if self.corrected {
            return false;
        }
        self.corrected = true;
        if self.sampled {
            // Early: the phase error is negative, the bit is cut short.
            let early = (self.bit_start + self.bit).saturating_sub(now);
            self.bit_start -= early.min(self.sjw);
        } else if !self.controller.drives_dominant() {
            // Late: the bit is stretched.
            self.bit_start += now.saturating_sub(self.bit_start).min(self.sjw);
        }
        false
    }
}
