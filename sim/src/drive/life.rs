//! Power-on, resets and the way back (CiA 301, 7.3.2.2.1).

use super::config::{DriveFault, Trouble};
use super::guarding::Guarding;
use super::network::Watch;
use super::service::SdoService;
use super::{Drive, Job, errors, layer};
use canmaster::NodeId;
use canmaster::nmt::Node;

/// How far the drive is on its way from power-on to its services.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Life {
    /// No supply.
    Off,
    /// Supply, but the software is still starting.
    Starting,
    /// NMT reset node came while the axis had torque: the drive brings it to
    /// rest as 6007h says, then starts as from power-on. It is deaf meanwhile.
    Resetting,
    /// NMT reset communication: the axis goes on, the communication starts.
    Restarting,
    /// Without node-ID: no NMT state, no boot-up message, nothing but LSS.
    Unconfigured,
    /// LSS changes the bit rate: silent, and deaf but for the bus itself.
    Silent,
    /// All services that the NMT state allows.
    Running,
}

impl Drive {
    pub(super) fn power_on(&mut self) {
        if self.life == Life::Off {
            self.start();
        }
    }

    pub(super) fn power_off(&mut self) {
        self.end_communication();
        self.controller.reset();
        self.axis.power_on_reset();
        self.nmt.reset();
        self.od.use_node(None);
        self.life = Life::Off;
    }

    /// From power-on, or after NMT reset node.
    fn start(&mut self) {
        self.end_communication();
        self.controller.reset();
        self.axis.power_on_reset();
        self.od.reset_node();
        self.od.use_node(None);
        self.switch_bit_rate();
        self.nmt.reset();
        self.life = Life::Starting;
        self.plan_boot();
    }

    pub(super) fn reset_node(&mut self) {
        self.end_communication();
        self.axis.connection_ends(&self.od);
        self.life = Life::Resetting;
        self.finish_reset();
    }

    /// The second half of a reset: the axis has no torque any more.
    pub(super) fn finish_reset(&mut self) {
        if self.life == Life::Resetting && !self.axis.powered() {
            self.start();
        }
    }

    pub(super) fn reset_communication(&mut self) {
        self.end_communication();
        self.axis.connection_ends(&self.od);
        self.od.reset_communication();
        self.life = Life::Restarting;
        self.plan_boot();
    }

    fn end_communication(&mut self) {
        // Whatever was planned for the old life is void.
        self.lives += 1;
        self.hesitates = false;
        self.bus_off = false;
        self.controller.clear();
        self.service.reset(&mut self.od);
        self.exchange.clear();
        self.watch.clear();
        self.od.operational = false;
    }

    fn plan_boot(&mut self) {
        let boot = self.config.boot.draw(&mut self.random);
        self.plan(self.now + self.clock.span(boot), Job::Boot);
    }

    /// The boot-up message, then pre-operational; without node-ID, LSS.
    pub(super) fn boot(&mut self) {
        let node = self.od.pending_node();
        self.od.use_node(node);
        self.lss = layer::slave(self.od.identity(), node);
        match node {
            Some(node) => self.enter_network(node),
            None => self.life = Life::Unconfigured,
        }
    }

    fn enter_network(&mut self, node: NodeId) {
        self.nmt = Node::new(node);
        self.service = SdoService::new(node, self.config.sdo_block_size);
        self.watch = Watch::new(node);
        self.guarding = Guarding::default();
        self.life = Life::Running;
        if let Some(frame) = self.nmt.boot() {
            self.transmit(frame);
        }
        self.start_watch();
        self.exchange.reload(&self.od);
    }

    /// An error occurs, with its message and its reaction.
    pub(super) fn raise(&mut self, code: u16, lasting: bool) {
        if matches!(self.life, Life::Off | Life::Starting) {
            return;
        }
        let new = if lasting {
            self.od.errors.raise_lasting(code)
        } else {
            self.od.errors.raise(code)
        };
        if new {
            self.axis.fault(errors::classify(code).1, &self.od);
            self.send_emcy(code);
        }
    }

    pub(super) fn cause_gone(&mut self, code: u16) {
        self.od.errors.cause_gone(code);
        let warning = errors::classify(code).1 == errors::Reaction::Warning;
        if warning && self.od.errors.warning_gone(code) {
            self.send_emcy(0);
        }
    }

    /// 6040h was written.
    pub(super) fn on_controlword(&mut self) {
        let since = |fault: &DriveFault| match *fault {
            DriveFault::ControlwordIgnored { at } => self.now >= at,
            _ => false,
        };
        let deaf = self.troubles().any(|trouble| trouble == Trouble::Deaf);
        if deaf || self.config.faults.iter().any(since) {
            return;
        }
        let word = self.od.number(0x6040, 0) as u16;
        let slow = self.troubles().find_map(|trouble| match trouble {
            Trouble::Slow(delay) => Some(delay),
            _ => None,
        });
        if let Some(delay) = slow {
            if !std::mem::replace(&mut self.hesitates, true) {
                let us = delay.draw(&mut self.random);
                self.plan(self.now + self.clock.span(us), Job::Hesitated);
            }
            return;
        }
        match self.control_delay {
            Some(delay) => {
                let us = delay.draw(&mut self.random);
                self.plan(self.now + self.clock.span(us), Job::Control(word));
            }
            None => self.control(word),
        }
    }

    /// The newest controlword acts at last.
    pub(super) fn hesitated(&mut self) {
        self.hesitates = false;
        self.control(self.od.number(0x6040, 0) as u16);
    }

    /// A controlword acts.
    pub(super) fn control(&mut self, word: u16) {
        if self.axis.control(word, &self.od) && self.od.errors.reset() {
            self.send_emcy(0);
        }
        self.watch_state();
    }
}
