//! The board as a CANopen device: what the other tasks know goes into its
//! object dictionary, what clients change comes out.
//!
//! NMT commands for the board, from the bus or by 1F82h, and what 1029h orders on
//! a communication error, are carried out whether or not it is the NMT master
//! (1F80h, bit 0), but never while an axis is enabled, which would be left without
//! its master: 1F82h:7Fh is refused then (1F82h:80h is for the other nodes), a command from the bus to the board alone is
//! left, and one to all nodes waits until the axes, whose drives have heard it
//! too, are off. Reset node and reset communication both start the board anew.

use crate::{
    axes::Axes,
    control::Control,
    counters::Count,
    derived::{self, AXES, PROGRAM, SYNC_LIMITS, TPDO_EVERY},
    log::News,
    measured,
};
use canmaster::{
    Frame, NodeId,
    boot::{Event, NetworkBoot},
    design,
    device::{self, Description, Device, Identity, MasterError},
    emcy::EmcyCode,
    frame::MAX_DATA,
    id::Address,
    master::{MasterOd, Notice, WrongLength},
    motion::{AxisCommand, Cause, Director, GroupEvent, GroupState, panel::Panel},
    network::Network,
    nmt::{Command, ErrorControl, NodeControl, State, Target},
    od::{self, Chunk, Part},
    sdo::AbortCode,
    store::{self, Store},
    time::{Duration, Instant},
};
use cortex_m::peripheral::SCB;
use nucleo_g474re::{can::ErrorState, flash};
use rtic::Mutex;

/// How long an SDO transfer of a client may stand still.
const SDO_TIMEOUT: Duration = Duration::from_millis(500);

fn description() -> Description {
    Description {
        device_type: 0,
        name: design::DEVICE_NAME,
        hardware: design::HARDWARE_VERSION,
        software: env!("CARGO_PKG_VERSION"),
        identity: Identity {
            serial: nucleo_g474re::serial_number(),
            ..Identity::default()
        },
        sync: SYNC_LIMITS,
        tpdo_every: TPDO_EVERY,
    }
}

/// Where the settings are kept.
pub(crate) type Storage = Store<flash::Storage>;

/// The last two pages of bank 2.
const PAGES: [u32; 2] = [
    (flash::PAGES as usize - 2) as u32 * flash::PAGE_BYTES as u32,
    (flash::PAGES as usize - 1) as u32 * flash::PAGE_BYTES as u32,
];

/// How long after an order to start anew the board still answers.
const LAST_WORDS: Duration = Duration::from_millis(10);

/// The process data that the object dictionary mirrors: TPDOs as they last came,
/// and what each axis was last told.
pub(crate) struct Mirror<'a, O, C, A> {
    pub(crate) network: &'static Network,
    pub(crate) boot: &'a NetworkBoot<AXES>,
    pub(crate) store: &'a mut Option<Storage>,
    pub(crate) od: &'a mut O,
    pub(crate) commands: &'a mut C,
    pub(crate) axes: &'a mut A,
    pub(crate) director: &'a mut Director<AXES>,
    pub(crate) panel: &'a mut Panel<AXES>,
}

impl<O, C, A> device::Board for Mirror<'_, O, C, A>
where
    O: Mutex<T = MasterOd<AXES>>,
    C: Mutex<T = [AxisCommand; AXES]>,
    A: Mutex<T = &'static mut Axes>,
{
    fn save(&mut self, settings: &[u8]) -> Result<(), AbortCode> {
        let store = self.store.as_mut().ok_or(AbortCode::DEVICE_STATE)?;
        Ok(store.save(settings)?)
    }

    fn can_save(&self) -> bool {
        self.store.is_some()
    }

    fn may_request(&mut self, control: NodeControl) -> Result<(), AbortCode> {
        // Why not, the boot status says (2F00h, 2F01h).
        let allowed = self.boot.may_request(control);
        allowed.map_err(|_| AbortCode::DEVICE_STATE)
    }

    fn number(&mut self, at: Address) -> Result<u32, AbortCode> {
        if at.index.0 == measured::INDEX {
            return Ok(measured::entry(at.sub.0));
        }
        let (panel, director) = (&*self.panel, &*self.director);
        Ok(self.axes.lock(|axes| panel.get(at, &axes.group, director)))
    }

    fn set_number(&mut self, at: Address, value: u32) -> Result<(), AbortCode> {
        if at.index.0 == measured::INDEX {
            measured::anew();
            return Ok(());
        }
        let (panel, director) = (&mut *self.panel, &mut *self.director);
        self.axes
            .lock(|axes| panel.set(at, value, &mut axes.group, director))
    }

    fn read(&mut self, _: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        let program = self.panel.program().unwrap_or(PROGRAM.as_slice());
        Ok(od::read_bytes(program, offset, buf))
    }

    fn write(&mut self, _: Address, part: Part<'_>) -> Result<(), AbortCode> {
        // Only this task lets a program run.
        let state = self.axes.lock(|axes| axes.group.state());
        self.panel.write(&part, state, self.director)
    }

    fn cancel(&mut self, _: Address) {
        self.panel.cancel();
    }

    fn tpdo(&mut self, node: NodeId, number: u8) -> [u8; 8] {
        match self.network.find(node) {
            Some((axis, _)) => self.od.lock(|od| pdo(od.image(axis), number)),
            None => [0; MAX_DATA],
        }
    }

    fn rpdo(&mut self, node: NodeId, number: u8) -> [u8; 8] {
        let data = self.network.find(node).and_then(|(axis, _)| {
            let command = self.commands.lock(|commands| commands.get(axis).copied())?;
            Some(derived::pdos(axis)?.rpdo(number, &command))
        });
        data.unwrap_or_default()
    }
}

/// The PDO `number`, counted from 1.
fn pdo(image: &[u8], number: u8) -> [u8; MAX_DATA] {
    let place = usize::from(number.wrapping_sub(1)) * MAX_DATA;
    let bytes = image.get(place..).and_then(|rest| rest.first_chunk());
    bytes.copied().unwrap_or_default()
}

/// See the module.
pub(crate) struct OwnNode {
    pub(crate) device: Device<AXES>,
    network: &'static Network,
    lost_frames: u32,
    bus_off: bool,
    /// An NMT command for the board that waits to be carried out.
    command: Option<Command>,
    /// When the board is to start anew.
    restart_at: Option<Instant>,
}

impl OwnNode {
    pub(crate) fn new(network: &'static Network) -> OwnNode {
        OwnNode {
            device: Device::new(description(), network, SDO_TIMEOUT),
            network,
            lost_frames: 0,
            bus_off: false,
            command: None,
            restart_at: None,
        }
    }

    /// Takes over the settings that were saved. Not inlined: the bytes are to
    /// leave the stack.
    #[inline(never)]
    pub(crate) fn load(
        &mut self,
        flash: Result<flash::Storage, flash::Unavailable>,
    ) -> Option<Storage> {
        let mut store = Store::new(flash.ok()?, PAGES).ok()?;
        let mut buf = [0; store::CAPACITY];
        match store.load(&mut buf) {
            Ok(Some(saved)) => self.device.load(saved, Instant::ZERO),
            Ok(None) => {}
            Err(_) => self.device.raise(MasterError::Storage),
        }
        Some(store)
    }

    /// The boot-up message, and the first heartbeat may follow.
    pub(crate) fn boot_up(&self) -> Frame {
        ErrorControl::heartbeat(self.network.master.node, State::Initialising).frame()
    }

    /// Takes over what the other tasks say of the board itself, and carries out
    /// a command that waits. `true`: the NMT state has changed.
    pub(crate) fn update(
        &mut self,
        control: &Control,
        board: &mut impl device::Board,
        now: Instant,
    ) -> bool {
        self.device.set_axes_enabled(control.axes_enabled);
        let state = control.state();
        let changed = state != self.device.state();
        if changed {
            self.device.set_state(state, board, now);
        }
        changed
    }

    /// An NMT command for the board, or for others.
    pub(crate) fn command(&mut self, control: NodeControl) {
        let mine = control.target.includes(self.network.master.node);
        let left = control.target != Target::All && self.device.axes_enabled();
        if mine && !left {
            self.command = Some(control.command);
        }
    }

    /// Carries out the command that waits, unless an axis is enabled. With
    /// `control` locked, so that none can be meanwhile.
    pub(crate) fn carry_out(&mut self, control: &mut Control, now: Instant) {
        if control.axes_enabled || !control.speaking {
            return;
        }
        let state = match self.command.take() {
            // The network is started by its boot-up.
            Some(Command::Start) if self.device.is_master() && !control.started => return,
            Some(Command::Start) => State::Operational,
            Some(Command::Stop) => State::Stopped,
            Some(Command::EnterPreOperational) => State::PreOperational,
            Some(Command::ResetNode | Command::ResetCommunication) => {
                self.restart_at.get_or_insert(now + LAST_WORDS);
                return;
            }
            Some(Command::Other(_)) | None => return,
        };
        control.commanded = Some(state);
    }

    /// Starts the board anew if it is time for that.
    pub(crate) fn restart(&self, now: Instant) {
        if self.restart_at.is_some_and(|at| now >= at) {
            SCB::sys_reset();
        }
    }

    /// What 1029h orders on a communication error.
    fn communication_error(&mut self) {
        let behaviour = self.device.settings().error_behaviour();
        let command = behaviour.reaction(self.device.state());
        self.command = command.or(self.command);
    }

    /// A frame for the board.
    pub(crate) fn on_frame(
        &mut self,
        frame: &Frame,
        now: Instant,
        board: &mut impl device::Board,
    ) -> Option<Frame> {
        if let Some(control) = NodeControl::decode(frame) {
            self.command(control);
            return None;
        }
        self.device.on_frame(frame, now, board)
    }

    /// A step of the boot-up.
    #[inline(never)]
    pub(crate) fn boot(&mut self, event: &Event) {
        self.device.on_boot_event(event);
        match *event {
            Event::Failed(node, ref failure) => {
                let letter = failure.status as u8;
                self.device.raise(MasterError::BootFailed { node, letter });
            }
            Event::Operational(node) | Event::NodeBack(node) => {
                let code = MasterError::BOOT_FAILED;
                self.device.clear_all(code, Some(node));
                self.device.clear(MasterError::NodeLost { node });
            }
            Event::NodeLost(node) => self.device.raise(MasterError::NodeLost { node }),
            Event::BusOff { .. } => self.device.set_sync_producer(false),
            _ => {}
        }
    }

    /// A frame of error control.
    pub(crate) fn error_control(&mut self, frame: &Frame) {
        if let Some(heard) = ErrorControl::decode(frame) {
            self.device.on_node_state(heard.node, Some(heard.state));
        }
    }

    /// What `network` had to say.
    #[inline(never)]
    pub(crate) fn news(&mut self, news: &News) {
        match news {
            News::Node(report) => match report.notice {
                Notice::Emcy { node, emcy } => self.device.on_emcy(node, emcy),
                Notice::HeartbeatLost(lost) => {
                    self.device.on_node_state(lost.node, None);
                    self.device.raise(MasterError::NodeLost { node: lost.node });
                    self.communication_error();
                }
                Notice::HeartbeatBack(node) => self.device.clear(MasterError::NodeLost { node }),
                Notice::BootUp(_) | Notice::NotOperational { .. } => {}
            },
            News::ErrorState(state) => self.error_state(*state),
            News::Measured => {}
            News::Counts => {
                let lost = Count::RxOverruns
                    .get()
                    .wrapping_add(Count::RxQueueFull.get());
                if lost != self.lost_frames {
                    self.lost_frames = lost;
                    self.tell(MasterError::Overrun);
                }
            }
            News::WrongLength(WrongLength { slot, short }) => {
                if let Some(node) = self.network.nodes.get(slot.axis()) {
                    self.tell(MasterError::PdoLength {
                        node: node.id,
                        tpdo: slot.number() as u8 + 1,
                        short: *short,
                    });
                }
            }
        }
    }

    fn error_state(&mut self, state: ErrorState) {
        if state == ErrorState::BusOff {
            self.bus_off = true;
            self.communication_error();
        } else if core::mem::take(&mut self.bus_off) {
            self.tell(MasterError::BusOffRecovered);
        }
        match state {
            ErrorState::Passive => self.device.raise(MasterError::ErrorPassive),
            ErrorState::Active => self.device.clear(MasterError::ErrorPassive),
            ErrorState::Warning | ErrorState::BusOff => {}
        }
    }

    /// An error that is over as soon as it is told.
    fn tell(&mut self, error: MasterError) {
        self.device.raise(error);
        self.device.clear(error);
    }

    /// What the group reports.
    #[inline(never)]
    pub(crate) fn group(&mut self, event: &GroupEvent) {
        if let GroupEvent::State { to, .. } = event
            && *to == GroupState::Enabling
        {
            for code in [MasterError::AXIS_FAULT, MasterError::PDO_MISSING] {
                self.device.clear_all(code, None);
            }
        }
        if let GroupEvent::Fault {
            axis: Some(axis),
            cause,
        } = event
            && let Some(node) = self.network.nodes.get(usize::from(*axis))
        {
            let node = node.id;
            let code = match cause.cause {
                Cause::Emergency => EmcyCode(cause.detail as u16),
                _ => EmcyCode::NO_ERROR,
            };
            self.device.raise(match cause.cause {
                Cause::TpdoMissing => MasterError::PdoMissing { node, tpdo: 0 },
                _ => MasterError::AxisFault { node, code },
            });
        }
    }
}
