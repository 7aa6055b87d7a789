//! What is simulated: which drives, which faults, for how long.

use std::collections::BTreeMap;

use canmaster::NodeId;
use canmaster::sdo::AbortCode;

use super::station;
use super::stimulus::Stimulus;
use crate::board::{BankContents, FlashOptions};
use crate::drive::{DriveConfig, DriveFault, Identity};
use crate::time::Time;

/// EPOS4 Module 24/1.5: the same maker's, but not the drive that the network
/// asks for.
const OTHER_PRODUCT: u32 = 0x6050_0000;

/// What may be wrong with a drive, by the names that the command line has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ailment {
    /// 1018h:2 is another product's.
    WrongIdentity,
    /// A write to this entry is answered with 06090030h.
    RefusesWrite {
        /// Index of the entry.
        index: u16,
        /// Sub-index of the entry.
        sub: u8,
    },
    /// Its memory is broken: it stores nothing.
    Forgetful,
    /// It sends nothing any more from full motion on.
    SilentInMotion,
}

/// A run to be made.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Seed of everything that is drawn at random.
    pub seed: u64,
    /// When it ends, from power-on.
    pub end: Time,
    /// Drives that are not on the bus.
    pub without: Vec<NodeId>,
    /// The drives come from the factory: none has a node-ID. They are switched on
    /// in an order drawn from the seed.
    pub factory: bool,
    /// Drives that the network does not name, each with a node-ID of its own.
    pub strangers: Vec<DriveConfig>,
    /// Changes every drive of the network before its faults are put in.
    pub tuned: fn(DriveConfig) -> DriveConfig,
    /// Faults that drives have from power-on.
    pub faults: BTreeMap<NodeId, Vec<DriveFault>>,
    /// Done at given moments.
    pub stimuli: Vec<(Time, Stimulus)>,
    /// Done once, when every axis is in full motion for the first time.
    pub in_motion: Vec<Stimulus>,
    /// Whether somebody presses the button as soon as the machine is ready.
    pub operated: bool,
    /// That person never waits: the machine moves all the time.
    pub restless: bool,
    /// Option bytes of the board's flash, and what its bank 2 holds.
    pub flash: FlashOptions,
}

impl Scenario {
    /// Six sound drives, an operator, nothing else happens.
    pub fn new(seed: u64, end: Time) -> Scenario {
        Scenario {
            seed,
            end,
            without: Vec::new(),
            factory: false,
            strangers: Vec::new(),
            tuned: |config| config,
            faults: BTreeMap::new(),
            stimuli: Vec::new(),
            in_motion: Vec::new(),
            operated: true,
            restless: false,
            flash: FlashOptions {
                seed,
                ..FlashOptions::default()
            },
        }
    }

    /// The same without a drive.
    pub fn without(mut self, node: NodeId) -> Scenario {
        self.without.push(node);
        self
    }

    /// The same with drives from the factory.
    pub fn from_factory(mut self) -> Scenario {
        self.factory = true;
        self
    }

    /// The same with one more drive without node-ID, which the network does not
    /// name.
    pub fn with_stranger(self) -> Scenario {
        let config = station::stranger(self.seed);
        self.stranger(config)
    }

    /// The same with another drive on the bus.
    pub fn stranger(mut self, config: DriveConfig) -> Scenario {
        self.strangers.push(config);
        self
    }

    /// The same with all drives of the network changed.
    pub fn tuned(mut self, tuned: fn(DriveConfig) -> DriveConfig) -> Scenario {
        self.tuned = tuned;
        self
    }

    /// The same with a fault in a drive, from power-on.
    pub fn fault(mut self, node: NodeId, fault: DriveFault) -> Scenario {
        self.faults.entry(node).or_default().push(fault);
        self
    }

    /// The same with a drive that ails in a way that has a name.
    pub fn ailing(self, node: NodeId, ailment: Ailment) -> Scenario {
        match ailment {
            Ailment::WrongIdentity => {
                let other = Identity {
                    product: OTHER_PRODUCT,
                    ..Identity::epos4(0)
                };
                self.fault(node, DriveFault::Identity(other))
            }
            Ailment::RefusesWrite { index, sub } => {
                let abort = AbortCode::VALUE_RANGE.0;
                self.fault(node, DriveFault::RefuseWrite { index, sub, abort })
            }
            Ailment::Forgetful => self.fault(node, DriveFault::StoreFails),
            Ailment::SilentInMotion => self.in_motion(Stimulus::Silence { node }),
        }
    }

    /// The same with something done at a moment.
    pub fn at(mut self, at: Time, stimulus: Stimulus) -> Scenario {
        self.stimuli.push((at, stimulus));
        self
    }

    /// The same with something done in full motion.
    pub fn in_motion(mut self, stimulus: Stimulus) -> Scenario {
        self.in_motion.push(stimulus);
        self
    }

    /// The same with none of the drives.
    pub fn without_drives(mut self) -> Scenario {
        self.without = (1..=NodeId::MAX.get()).filter_map(NodeId::new).collect();
        self
    }

    /// The same with what bank 2 of the board's flash holds.
    pub fn stored(mut self, bank2: BankContents) -> Scenario {
        self.flash.bank2 = Some(bank2);
        self
    }

    /// The same with somebody who presses the button as soon as the machine is at
    /// rest.
    pub fn restless(mut self) -> Scenario {
        self.restless = true;
        self
    }

    /// The same with nobody who presses the button.
    pub fn unattended(mut self) -> Scenario {
        self.operated = false;
        self
    }
}
