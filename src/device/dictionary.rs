//! The dictionary itself: the values and the state behind its entries.

use super::node_record::{NodeRecord, NodeStatus, Presence};
use super::own_tpdo::OwnTpdos;
use super::settings::{Setting, Settings, nodes};
use super::transfer::TransferTest;
use super::{Board, Description, Event};
use crate::boot;
use crate::emcy;
use crate::id::NodeId;
use crate::network::{Network, Node};
use crate::nmt::{Command, NodeControl, State, Target};
use crate::sdo::AbortCode;
use crate::store;
use crate::time_of_day::Clock;
use heapless::Deque;

/// Events that may wait. One SDO write causes one; they are fetched after each.
const EVENTS: usize = 4;

/// Values and state behind the entries.
#[derive(Debug)]
// In this order, so that what is used most is near: it takes shorter instructions.
#[repr(C)]
pub(super) struct Dictionary<const N: usize> {
    pub(super) state: State,
    /// 1F80h, bit 0, as it was when the device started.
    pub(super) is_master: bool,
    pub(super) axes_enabled: bool,
    pub(super) status: u32,
    pub(super) network: &'static Network,
    pub(super) settings: Settings<N>,
    /// 2F12h
    pub(super) transfer: TransferTest,
    pub(super) own_tpdos: OwnTpdos,
    pub(super) events: Deque<Event, EVENTS>,
    pub(super) errors: emcy::Producer,
    pub(super) description: Description,
    pub(super) clock: Clock,
    pub(super) nodes: [NodeRecord; N],
}

impl<const N: usize> Dictionary<N> {
    pub(super) fn node(&self, node: NodeId) -> Option<(&'static Node, &NodeRecord)> {
        let (place, node) = self.network.find(node)?;
        Some((node, self.nodes.get(place)?))
    }

    pub(super) fn record(&mut self, node: NodeId) -> Option<&mut NodeRecord> {
        let (place, _) = self.network.find(node)?;
        self.nodes.get_mut(place)
    }

    pub(super) fn push(&mut self, event: Event) -> Result<(), AbortCode> {
        self.events
            .push_back(event)
            .map_err(|_| AbortCode::OUT_OF_MEMORY)
    }

    pub(super) fn change(&mut self, setting: Setting, value: u32) -> Result<(), AbortCode> {
        if setting.needs_pre_operational() && self.state != State::PreOperational {
            return Err(AbortCode::DEVICE_STATE);
        }
        if self.events.is_full() {
            return Err(AbortCode::OUT_OF_MEMORY);
        }
        self.settings.set(setting, value, &self.description.sync)?;
        self.push(Event::Changed(setting))
    }

    /// 1F82h (CiA 302-2).
    pub(super) fn request_nmt(
        &mut self,
        board: &mut impl Board,
        node: Option<NodeId>,
        value: u8,
    ) -> Result<(), AbortCode> {
        let command = match value {
            4 => Command::Stop,
            5 => Command::Start,
            6 => Command::ResetNode,
            7 => Command::ResetCommunication,
            127 => Command::EnterPreOperational,
            _ => return Err(AbortCode::VALUE_RANGE),
        };
        let target = node.map_or(Target::All, Target::Node);
        let control = NodeControl { command, target };
        if node != Some(self.network.master.node) {
            self.may_request(board, control)?;
        } else if self.axes_enabled && command != Command::Start {
            // The axes would be left without their master.
            return Err(AbortCode::DEVICE_STATE);
        }
        self.push(Event::Nmt(control))
    }

    pub(super) fn may_request(
        &self,
        board: &mut impl Board,
        control: NodeControl,
    ) -> Result<(), AbortCode> {
        if !self.is_master {
            return Err(AbortCode::DEVICE_STATE);
        }
        board.may_request(control)
    }

    /// 1010h and 1011h: the device does nothing else for some 25 ms, so that no
    /// axis may be enabled meanwhile.
    pub(super) fn store(
        &mut self,
        board: &mut impl Board,
        signature: (u32, u32),
        restore: bool,
    ) -> Result<(), AbortCode> {
        let (given, wanted) = signature;
        if given != wanted {
            return Err(AbortCode::CANNOT_STORE);
        }
        if self.axes_enabled || !board.can_save() {
            return Err(AbortCode::DEVICE_STATE);
        }
        let mut buf = [0; store::CAPACITY];
        let len = if restore {
            0
        } else {
            self.settings.encode(self.network, &mut buf)?
        };
        let saved = board.save(buf.get(..len).unwrap_or(&[]));
        let error = super::MasterError::Storage.emcy();
        match saved {
            Ok(()) => self.errors.clear(error),
            Err(_) => self.errors.raise(error),
        }
        saved
    }

    /// Takes note of a step of the boot-up.
    #[inline(never)]
    pub(super) fn on_boot_event(&mut self, event: &boot::Event) {
        let Some(status) = NodeStatus::after(event) else {
            return;
        };
        let Some(node) = event.node() else {
            let nodes = usize::from(nodes::<N>(self.network));
            for record in self.nodes.iter_mut().take(nodes) {
                record.status = status;
            }
            return;
        };
        let Some(record) = self.record(node) else {
            return;
        };
        record.status = status;
        // A node that was never heard counts as lost when its boot time is over.
        if let boot::Event::Failed(_, failure) = event
            && failure.cause == boot::Cause::NoBootUp
            && record.presence == Presence::UNKNOWN
        {
            record.presence = Presence::MISSING;
        }
    }
}
