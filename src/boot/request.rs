//! NMT commands by request: object 1F82h (CiA 302-2).

use super::event::Action;
use super::network::NetworkBoot;
use super::node::NodeBoot;
use super::phase::Phase;
use crate::nmt::{Command, NodeControl, Target};
use crate::time::Instant;
use crate::words::in_words;

/// Why a requested NMT command was not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Refusal {
    /// The nodes are being booted, or the master does not speak.
    Booting,
    /// The start was halted, or all nodes were stopped after an error.
    Halted,
    /// A mandatory node is not booted.
    MandatoryMissing,
    /// The node is not booted, so that it must not be started.
    NotBooted,
    /// The network does not name it.
    UnknownNode,
    /// Not a command that the standard knows.
    UnknownCommand,
}

in_words!(Refusal {
    Refusal::Booting => ("the nodes are being booted; request it again when they are"),
    Refusal::Halted => ("the network is halted; request a reset of all nodes first"),
    Refusal::MandatoryMissing => ("a mandatory node is not booted; see its boot status"),
    Refusal::NotBooted => ("the node is not booted; see its boot status"),
    Refusal::UnknownNode => ("the network does not name this node"),
    Refusal::UnknownCommand => ("not an NMT command of the standard"),
});

impl core::error::Error for Refusal {}

impl<const N: usize> NetworkBoot<N> {
    /// Sends an NMT command as 1F82h requests it. A node that is stopped stays
    /// so until it is requested to start; one that is reset is booted again. With
    /// [`Command::Start`] to all nodes, or to the master itself, the start that
    /// 1F80h, bit 2, leaves to the application is ordered.
    ///
    /// # Errors
    /// See [`Refusal`]; nothing was sent.
    pub fn request(&mut self, control: NodeControl, now: Instant) -> Result<(), Refusal> {
        let NodeControl { command, target } = control;
        let to_master = target == Target::Node(self.network.master.node);
        let known = |boot: &NodeBoot| target.includes(boot.node().id);
        if !to_master && !self.nodes.iter().any(known) {
            return Err(Refusal::UnknownNode);
        }
        match (command, self.phase) {
            (Command::Other(_), _) => Err(Refusal::UnknownCommand),
            (
                Command::ResetNode | Command::ResetCommunication,
                Phase::Booting
                | Phase::AwaitingOrder
                | Phase::Synchronising { .. }
                | Phase::Starting
                | Phase::Running
                | Phase::Stopped
                | Phase::Failed,
            ) if target == Target::All => {
                self.broadcast(command);
                self.ran = false;
                self.begin_all(false, now);
                Ok(())
            }
            (_, Phase::Failed | Phase::Stopped) => Err(Refusal::Halted),
            (Command::Start, Phase::AwaitingOrder) if target == Target::All || to_master => {
                if !self.mandatory_up() {
                    return Err(Refusal::MandatoryMissing);
                }
                self.ordered = true;
                self.synchronise(now);
                Ok(())
            }
            (_, Phase::Running) if !to_master => self.request_running(control, now),
            _ => Err(Refusal::Booting),
        }
    }

    fn request_running(&mut self, control: NodeControl, now: Instant) -> Result<(), Refusal> {
        let NodeControl { command, target } = control;
        if command == Command::Start && !self.mandatory_up() {
            return Err(Refusal::MandatoryMissing);
        }
        if let Target::Node(id) = target {
            let boot_time = self.boot_time;
            let node = self.nodes.iter_mut().find(|boot| boot.node().id == id);
            let node = node.ok_or(Refusal::UnknownNode)?;
            if matches!(command, Command::ResetNode | Command::ResetCommunication) {
                node.reset_by_request(command, boot_time, now);
                return Ok(());
            }
            if !node.is_up() {
                return Err(Refusal::NotBooted);
            }
        } else if command == Command::Stop && !self.nodes.iter().all(NodeBoot::is_settled) {
            // A stopped node has no SDO: its boot-up would fail.
            return Err(Refusal::Booting);
        }
        let included = |boot: &&mut NodeBoot| target.includes(boot.node().id);
        for node in self.nodes.iter_mut().filter(included) {
            node.hold(command != Command::Start);
            // A node that is started again after that goes the usual way.
            if command == Command::Start && node.is_startable() {
                node.start(true, now);
            }
        }
        if command != Command::Start {
            self.push(Action::Send(control.frame()));
        }
        Ok(())
    }
}
