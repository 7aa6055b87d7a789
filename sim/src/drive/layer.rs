//! Layer setting services, the drive's end (CiA 305; EPOS4: only in NMT stopped,
//! or without node-ID).

use super::config::Identity;
use super::dictionary::Dictionary;
use super::life::Life;
use super::{Drive, Job, bit_rate};
use canmaster::lss::{
    BitRate, ConfigurationResult, Device, LssAddress, LssSlave, Mode, Request, SlaveEvent,
};
use canmaster::nmt::Service;
use canmaster::{CobId, Frame, NodeId};

/// Microseconds in a millisecond, the unit of the switch delay.
const US_PER_MS: u64 = 1000;

/// The slave of a drive with this identity and node-ID.
pub(super) fn slave(identity: Identity, node: Option<NodeId>) -> LssSlave {
    let address = LssAddress {
        vendor: identity.vendor,
        product: identity.product,
        revision: identity.revision,
        serial: identity.serial,
    };
    LssSlave::new(address, node)
}

/// 2000h and 2001h are what LSS configures.
impl Device for Dictionary {
    fn configure_bit_timing(&mut self, table: u8, index: u8) -> ConfigurationResult {
        if table != BitRate::STANDARD_TABLE || !bit_rate::exists(index) {
            return ConfigurationResult::REFUSED;
        }
        self.put(0x2001, 0, index.into());
        ConfigurationResult::OK
    }

    fn store(&mut self, _node: Option<NodeId>) -> ConfigurationResult {
        match self.store_layer() {
            Ok(()) => ConfigurationResult::OK,
            Err(_) => ConfigurationResult::MEDIUM,
        }
    }
}

impl Drive {
    pub(super) fn on_layer_frame(&mut self, frame: &Frame) {
        let available = match self.life {
            Life::Unconfigured => true,
            Life::Running => self.nmt.allows(Service::Lss),
            _ => false,
        };
        if !available || frame.id() != CobId::LSS_MASTER || frame.is_remote() {
            return;
        }
        if self.lss.mode() == Mode::Configuration
            && let Some(Request::NodeId(node)) = Request::decode(frame)
        {
            self.od.set_pending_node(node);
        }
        match self.lss.on_frame(frame, &mut self.od) {
            Some(SlaveEvent::Send(answer)) => {
                let us = self.config.lss_latency.draw(&mut self.random);
                let at = self.now + self.clock.span(us);
                self.plan(at, Job::Answer(answer));
            }
            // The node-ID is pending in 2000h.
            Some(SlaveEvent::Boot(_)) => self.reset_communication(),
            Some(SlaveEvent::Activate { delay }) => self.fall_silent(delay),
            None => {}
        }
    }

    /// CiA 305, 3.9.4: `delay` milliseconds of silence, the other bit rate, and
    /// as much silence again.
    fn fall_silent(&mut self, delay: u16) {
        self.controller.clear();
        self.life = Life::Silent;
        let us = u64::from(delay) * US_PER_MS;
        let switch = self.now + self.clock.span(us);
        self.plan(switch, Job::SwitchBitRate);
        self.plan(switch + self.clock.span(us), Job::SpeakAgain);
    }

    pub(super) fn switch_bit_rate(&mut self) {
        let code = self.od.number(0x2001, 0) as u8;
        self.bit_rate = bit_rate::bits_per_second(code, self.config.bit_rate);
    }

    pub(super) fn speak_again(&mut self) {
        self.life = match self.od.node() {
            Some(_) => Life::Running,
            None => Life::Unconfigured,
        };
    }
}
