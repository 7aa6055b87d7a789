//! NMT commands by request: object 1F82h (CiA 302-2).

use super::event::Action;
use super::network::NetworkBoot;
use super::node::{NodeBoot, Trait};
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
    /// As [`may_request`](Self::may_request); nothing was sent.
    #[inline(never)]
    pub fn request(&mut self, control: NodeControl, now: Instant) -> Result<(), Refusal> {
        self.may_request(control)?;
        self.set_now(now);
        let NodeControl { command, target } = control;
        match target {
            Target::All if is_reset(command) => {
                self.broadcast(command);
                self.ran = false;
                self.begin_all(false);
            }
            _ if self.phase == Phase::AwaitingOrder => {
                self.ordered = true;
                self.synchronise();
            }
            Target::Node(id) if is_reset(command) => {
                if let Some(node) = self.node_mut(id) {
                    node.reset_by_request(command);
                }
            }
            _ => self.command(control),
        }
        Ok(())
    }

    /// Whether a [`request`](Self::request) would be carried out now.
    ///
    /// # Errors
    /// See [`Refusal`].
    pub fn may_request(&self, control: NodeControl) -> Result<(), Refusal> {
        let NodeControl { command, target } = control;
        let to_all = target == Target::All;
        let to_master = target == Target::Node(self.network.master.node);
        let mut nodes = self.nodes.iter();
        let node = nodes.find(|boot| target.includes(boot.node().id));
        Err(match (self.phase, node) {
            _ if matches!(command, Command::Other(_)) => Refusal::UnknownCommand,
            (_, None) if !to_master => Refusal::UnknownNode,
            // The master does not speak.
            (Phase::NotMaster | Phase::Silent | Phase::BusOff, _) => Refusal::Booting,
            // This leads out of everything else.
            _ if to_all && is_reset(command) => return Ok(()),
            (Phase::Failed | Phase::Stopped, _) => Refusal::Halted,
            (Phase::AwaitingOrder, _) if command == Command::Start && (to_all || to_master) => {
                if self.mandatory_up() {
                    return Ok(());
                }
                Refusal::MandatoryMissing
            }
            (Phase::Running, Some(_)) if command == Command::Start && !self.mandatory_up() => {
                Refusal::MandatoryMissing
            }
            // A stopped node has no SDO: its boot-up would fail.
            (Phase::Running, Some(_))
                if to_all && command == Command::Stop && self.any(Trait::UNSETTLED) =>
            {
                Refusal::Booting
            }
            (Phase::Running, Some(node)) if to_all || is_reset(command) || node.is_up() => {
                return Ok(());
            }
            (Phase::Running, Some(_)) => Refusal::NotBooted,
            _ => Refusal::Booting,
        })
    }

    fn command(&mut self, control: NodeControl) {
        let NodeControl { command, target } = control;
        let included = |boot: &&mut NodeBoot| target.includes(boot.node().id);
        for node in self.nodes.iter_mut().filter(included) {
            node.hold(command != Command::Start);
            // A node that is started again after that goes the usual way.
            if command == Command::Start && !node.has(Trait::NOT_STARTABLE) {
                node.start(true);
            }
        }
        if command != Command::Start {
            self.push(Action::Send(control.frame()));
        }
    }
}

fn is_reset(command: Command) -> bool {
    matches!(command, Command::ResetNode | Command::ResetCommunication)
}
