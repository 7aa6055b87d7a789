//! The description of a network: what is on the bus, what each node must be,
//! and what is written to it. Everything is `const`, so that it lies in flash.

mod plan;
pub mod sample;

pub(crate) use plan::cob_id;
pub use plan::{ConfigWrite, plan, planned};

use crate::id::NodeId;
use crate::pdo::{MappingEntry, Transmission};
use crate::time::Duration;

/// PDOs that every node of the predefined connection set has in each direction
/// (CiA 301, 7.3.5).
pub const PDOS_PER_NODE: u8 = 4;

/// A network: the master and its nodes on one bus.
#[derive(Debug)]
pub struct Network {
    /// Bits per second.
    pub bit_rate: u32,
    /// SYNC period: 1006h of the master.
    pub cycle: Duration,
    /// How the master behaves.
    pub master: Master,
    /// The nodes, in the order of the axes.
    pub nodes: &'static [Node],
}

/// The master's own parameters.
#[derive(Debug)]
pub struct Master {
    /// Its node-ID, as which it sends its heartbeat.
    pub node: NodeId,
    /// Its producer heartbeat time (1017h).
    pub heartbeat: Duration,
    /// How long it keeps silent after a reset. Longer than the longest consumer
    /// heartbeat time of the nodes plus their stopping ramp, so that drives
    /// which a reset left running are at rest before anybody speaks to them.
    pub silence: Duration,
    /// Boot time (1F89h): a mandatory node unseen this long after the reset
    /// command ends the start.
    pub boot_time: Duration,
    /// How often an SDO request is tried before the node is given up.
    pub sdo_tries: u8,
    /// SYNCs sent before NMT start, so that every node has seen the period.
    pub syncs_before_start: u8,
}

/// One node and what it must be.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Its node-ID.
    pub id: NodeId,
    /// Without a mandatory node the network does not start (1F81h, bit 3).
    pub mandatory: bool,
    /// What people call it.
    pub name: &'static str,
    /// What 1018h:4 must say (1F88h). `None` is not checked.
    pub serial: Option<u32>,
    /// The rest, which can be read as if it were the node's own.
    pub kind: &'static Kind,
}

impl core::ops::Deref for Node {
    type Target = Kind;

    fn deref(&self) -> &Kind {
        self.kind
    }
}

impl Node {
    /// 1000h: 0; the sub-indices of 1018h: 1 ..= 4.
    #[inline(never)]
    pub(crate) const fn number(&self, n: u8) -> Option<u32> {
        match n {
            0 => self.kind.identity.device_type,
            1 => self.kind.identity.vendor,
            2 => self.kind.identity.product,
            3 => self.kind.identity.revision,
            _ => self.serial,
        }
    }
}

/// What nodes of one kind have in common: it lies in flash once.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// What 1000h and 1018h must say.
    pub identity: Identity,
    /// Producer heartbeat time of the node (1017h), milliseconds; 0 = none.
    pub heartbeat_ms: u16,
    /// How long the node waits for the master's heartbeat (1016h),
    /// milliseconds.
    pub consumer_ms: u16,
    /// RPDOs in use; all others are switched off.
    pub rpdos: &'static [Pdo],
    /// TPDOs in use; all others are switched off.
    pub tpdos: &'static [Pdo],
    /// Further objects and their start values, written in this order.
    pub start_values: &'static [ConfigWrite],
    /// How long its SDO server may take to answer.
    pub sdo_timeout: Duration,
    /// 1F26h and 1F27h: date and time in 1020h:1 and 1020h:2 of the node when
    /// it is configured already. 0 and 0: it is configured at every boot-up, as
    /// a node without 1020h has to be.
    pub configured: [u32; 2],
}

/// Expected identity but for the serial number (1F84h .. 1F87h, CiA 302-2). `None` is
/// not checked.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// 1000h.
    pub device_type: Option<u32>,
    /// 1018h:1.
    pub vendor: Option<u32>,
    /// 1018h:2.
    pub product: Option<u32>,
    /// 1018h:3.
    pub revision: Option<u32>,
}

/// One PDO of a node, with the identifier of the predefined connection set.
#[derive(Debug)]
pub struct Pdo {
    /// 1 ..= 4.
    pub number: u8,
    /// Transmission type (CiA 301, 7.5.2.35).
    pub transmission: Transmission,
    /// What it carries, first byte first.
    pub mapping: &'static [MappingEntry],
}

impl Network {
    /// The node with this node-ID and its place in the list.
    pub fn find(&self, id: NodeId) -> Option<(usize, &'static Node)> {
        self.nodes
            .iter()
            .enumerate()
            .find(|(_, node)| node.id == id)
    }
}
