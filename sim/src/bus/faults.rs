//! Disturbances that a test orders.

use super::types::{BusFault, PortId};
use crate::frame::{WireFrame, WireId};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// What a disturbance does while it lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effect {
    /// The level is inverted, for one node or for all.
    Invert(Option<PortId>),
    /// One node, or every node, hears only itself.
    Cut(Option<PortId>),
    Dominant,
}

#[derive(Clone, Copy, Debug)]
struct Window {
    from: u64,
    until: u64,
    effect: Effect,
    begun: bool,
}

#[derive(Clone, Copy, Debug)]
struct Noise {
    rate: f64,
    until: u64,
    /// The next disturbed bit.
    next: u64,
    bit: u64,
}

#[derive(Clone, Copy, Debug)]
struct Flip {
    id: WireId,
    bit: u32,
    seen_by: Option<PortId>,
}

#[derive(Debug)]
pub(super) struct Faults {
    rng: Pcg64Mcg,
    windows: Vec<Window>,
    noise: Vec<Noise>,
    flips: Vec<Flip>,
}

/// The disturbances of one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Disturbance {
    pub(super) dominant: bool,
    pub(super) inverted: bool,
    pub(super) all_alone: bool,
}

impl Faults {
    pub(super) fn new(seed: u64) -> Faults {
        Faults {
            rng: Pcg64Mcg::seed_from_u64(seed),
            windows: Vec::new(),
            noise: Vec::new(),
            flips: Vec::new(),
        }
    }

    /// `bit` is the length of a bit, for noise.
    pub(super) fn add(&mut self, fault: BusFault, now: u64, bit: u64) {
        let mut window = |effect, from: u64, until: u64| {
            self.windows.push(Window {
                from: from.max(now),
                until,
                effect,
                begun: false,
            });
        };
        match fault {
            BusFault::Cut {
                isolated,
                from,
                until,
            } => window(Effect::Cut(isolated), from.0, until.0),
            BusFault::StuckDominant { from, until } => window(Effect::Dominant, from.0, until.0),
            BusFault::FlipBit { id, bit, seen_by } => self.flips.push(Flip { id, bit, seen_by }),
            BusFault::BitErrors { rate, from, until } => {
                let mut noise = Noise {
                    rate,
                    until: until.0,
                    next: from.0.max(now),
                    bit,
                };
                noise.draw(&mut self.rng);
                if noise.next < noise.until {
                    self.noise.push(noise);
                }
            }
        }
    }

    /// When the disturbances change next.
    pub(super) fn next_change(&self) -> u64 {
        let windows = self
            .windows
            .iter()
            .map(|w| if w.begun { w.until } else { w.from });
        let noise = self.noise.iter().map(|n| n.next);
        windows.chain(noise).min().unwrap_or(u64::MAX)
    }

    /// Begins and ends what is due.
    pub(super) fn apply(&mut self, now: u64) {
        for noise in &mut self.noise {
            while noise.next <= now && noise.next < noise.until {
                self.windows.push(Window {
                    from: noise.next,
                    until: noise.next + noise.bit,
                    effect: Effect::Invert(None),
                    begun: false,
                });
                noise.next += noise.bit;
                noise.draw(&mut self.rng);
            }
        }
        self.noise.retain(|noise| noise.next < noise.until);
        for window in &mut self.windows {
            window.begun |= window.from <= now;
        }
        self.windows.retain(|w| w.until > now);
    }

    /// A node drives bit `index` of `frame`, `bit` picoseconds long: inverts
    /// it if that was ordered.
    pub(super) fn on_bit(&mut self, frame: &WireFrame, index: u32, now: u64, bit: u64) -> bool {
        let due = |flip: &Flip| flip.id == frame.id && flip.bit == index;
        let Some(found) = self.flips.iter().position(due) else {
            return false;
        };
        let flip = self.flips.remove(found);
        self.windows.push(Window {
            from: now,
            until: now + bit,
            effect: Effect::Invert(flip.seen_by),
            begun: true,
        });
        true
    }

    /// Whether a bit flip waits for this identifier.
    pub(super) fn awaits(&self, id: WireId) -> bool {
        self.flips.iter().any(|flip| flip.id == id)
    }

    /// Whether anything disturbs the bus now.
    pub(super) fn any_active(&self) -> bool {
        self.windows.iter().any(|w| w.begun)
    }

    fn active(&self) -> impl Iterator<Item = Effect> + '_ {
        self.windows.iter().filter(|w| w.begun).map(|w| w.effect)
    }

    /// What disturbs everybody now.
    pub(super) fn common(&self) -> Disturbance {
        let mut now = Disturbance::default();
        for effect in self.active() {
            match effect {
                Effect::Dominant => now.dominant = true,
                Effect::Invert(None) => now.inverted = !now.inverted,
                Effect::Cut(None) => now.all_alone = true,
                Effect::Invert(Some(_)) | Effect::Cut(Some(_)) => {}
            }
        }
        now
    }

    /// Whether this node alone sees the level inverted.
    pub(super) fn inverted_for(&self, port: usize) -> bool {
        let mine = |effect: &Effect| *effect == Effect::Invert(Some(PortId(port)));
        self.active().filter(mine).count() % 2 == 1
    }

    /// Whether this node is cut off from the others.
    pub(super) fn isolates(&self, port: usize) -> bool {
        self.active()
            .any(|e| e == Effect::Cut(None) || e == Effect::Cut(Some(PortId(port))))
    }
}

impl Noise {
    /// The distance between two disturbed bits has a geometric distribution.
    fn draw(&mut self, rng: &mut Pcg64Mcg) {
        let u: f64 = rng.random();
        let gap = (1.0 - u).ln() / (-self.rate).ln_1p();
        let ps = (gap * self.bit as f64).max(0.0);
        // A rate of zero never comes: the gap is infinite and saturates.
        self.next = self.next.saturating_add(ps as u64);
    }
}
