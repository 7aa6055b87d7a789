//! The board as a CANopen device: what the other tasks know goes into its
//! object dictionary, what clients change comes out.

use crate::{control::Control, log::News};
use canmaster::{
    Frame, NodeId,
    boot::Event,
    design::{self, AXES},
    device::{self, Description, Device, Identity, MasterError, Setting, Settings},
    emcy::EmcyCode,
    master::{self, MasterOd, Notice, TpdoSlot},
    motion::{AxisCommand, FaultCause, GroupEvent},
    network::Network,
    nmt::{ErrorControl, State},
    sdo::AbortCode,
    time::{Duration, Instant},
};
use nucleo_g474re::can::ErrorState;
use rtic::Mutex;

/// How long an SDO transfer of a client may stand still.
const SDO_TIMEOUT: Duration = Duration::from_millis(500);

fn description() -> Description {
    Description {
        device_type: 0,
        name: "canmaster",
        hardware: "NUCLEO-G474RE",
        software: env!("CARGO_PKG_VERSION"),
        identity: Identity {
            serial: nucleo_g474re::serial_number(),
            ..Identity::default()
        },
        sync: design::SYNC_LIMITS,
    }
}

/// What a client has changed that another task has to take over.
#[derive(Clone, Copy)]
pub(crate) enum Order {
    /// 1017h.
    Heartbeat(Duration),
    /// 1016h; zero: not watched.
    Consumer(NodeId, Duration),
}

/// The process data that the object dictionary mirrors: TPDOs as they last came,
/// and what each axis was last told.
pub(crate) struct Mirror<'a, O, C> {
    pub(crate) network: &'static Network,
    pub(crate) od: &'a mut O,
    pub(crate) commands: &'a mut C,
}

impl<O, C> device::Board for Mirror<'_, O, C>
where
    O: Mutex<T = MasterOd<AXES>>,
    C: Mutex<T = [AxisCommand; AXES]>,
{
    fn save(&mut self, _: &[u8]) -> Result<(), AbortCode> {
        // This board keeps nothing over power-off yet.
        Err(AbortCode::DEVICE_STATE)
    }

    fn can_save(&self) -> bool {
        false
    }

    fn tpdo(&mut self, node: NodeId, number: u8) -> [u8; 8] {
        let slot = self.network.find(node).and_then(|(axis, _)| {
            let number = usize::from(number).checked_sub(1)?;
            TpdoSlot::new(axis, number)
        });
        slot.map(|slot| self.od.lock(|od| od.tpdo(slot)))
            .unwrap_or_default()
    }

    fn rpdo(&mut self, node: NodeId, number: u8) -> [u8; 8] {
        let Some((axis, _)) = self.network.find(node) else {
            return [0; 8];
        };
        let command = self.commands.lock(|commands| commands.get(axis).copied());
        let command = command.unwrap_or_default();
        let frame = match number {
            1 => master::rpdo1(node, &command),
            _ => master::rpdo2(node, &command),
        };
        let mut bytes = [0; 8];
        for (byte, sent) in bytes.iter_mut().zip(frame.data()) {
            *byte = *sent;
        }
        bytes
    }
}

/// See the module.
pub(crate) struct OwnNode {
    pub(crate) device: Device<AXES>,
    network: &'static Network,
    state: State,
    lost_frames: u32,
}

impl OwnNode {
    pub(crate) fn new(network: &'static Network) -> OwnNode {
        OwnNode {
            device: Device::new(description(), network, SDO_TIMEOUT),
            network,
            state: State::Initialising,
            lost_frames: 0,
        }
    }

    /// The network that the board is the master of.
    pub(crate) const fn network(&self) -> &'static Network {
        self.network
    }

    /// Takes over what the other tasks say of the board itself.
    pub(crate) fn update(
        &mut self,
        control: &Control,
        board: &mut impl device::Board,
        now: Instant,
    ) {
        self.device.set_axes_enabled(control.axes_enabled);
        let state = control.state();
        if state != self.state {
            self.state = state;
            self.device.set_state(state, board, now);
        }
    }

    /// A step of the boot-up.
    pub(crate) fn boot(&mut self, event: &Event) {
        self.device.on_boot_event(event);
        if let Event::Failed(node, failure) = *event {
            let letter = failure.status.letter() as u8;
            self.device.raise(MasterError::BootFailed { node, letter });
        }
    }

    /// A frame of error control.
    pub(crate) fn error_control(&mut self, frame: &Frame) {
        if let Some(heard) = ErrorControl::decode(frame) {
            self.device.on_node_state(heard.node, Some(heard.state));
        }
    }

    /// What `network` had to say.
    pub(crate) fn news(&mut self, news: &News) {
        match news {
            News::Node(report) => match report.notice {
                Notice::Emcy { node, emcy } => self.device.on_emcy(node, emcy),
                Notice::HeartbeatLost(lost) => {
                    self.device.on_node_state(lost.node, None);
                    self.device.raise(MasterError::NodeLost { node: lost.node });
                }
                Notice::HeartbeatBack(node) => self.device.clear(MasterError::NodeLost { node }),
                Notice::BootUp(_) | Notice::NotOperational { .. } => {}
            },
            News::ErrorState(ErrorState::Passive) => self.device.raise(MasterError::ErrorPassive),
            News::ErrorState(ErrorState::Active) => self.device.clear(MasterError::ErrorPassive),
            News::ErrorState(ErrorState::Warning | ErrorState::BusOff) => {}
            News::Counts(counts) => {
                let lost = counts.rx_overruns.wrapping_add(counts.rx_queue_full);
                if lost != self.lost_frames {
                    self.lost_frames = lost;
                    // It is over as soon as it is told.
                    self.device.raise(MasterError::Overrun);
                    self.device.clear(MasterError::Overrun);
                }
            }
        }
    }

    /// What the group reports.
    pub(crate) fn group(&mut self, event: &GroupEvent) {
        if let GroupEvent::Fault {
            axis: Some(axis),
            cause,
        } = event
            && let Some(node) = self.network.nodes.get(usize::from(*axis))
        {
            let code = match cause {
                FaultCause::Emergency { code } => EmcyCode(*code),
                _ => EmcyCode::NO_ERROR,
            };
            let node = node.id;
            self.device.raise(MasterError::AxisFault { node, code });
        }
    }

    /// What `network` has to know of a changed setting.
    pub(crate) fn orders(&self, setting: Setting, mut give: impl FnMut(Order)) {
        let settings: &Settings<AXES> = self.device.settings();
        match setting {
            Setting::ProducerHeartbeat => give(Order::Heartbeat(settings.heartbeat())),
            Setting::ConsumerHeartbeat(_) => {
                for node in self.network.nodes {
                    let time = settings.consumer_time(node.id).unwrap_or(Duration::ZERO);
                    give(Order::Consumer(node.id, time));
                }
            }
            _ => {}
        }
    }
}
