//! The master as a CANopen device: its own object dictionary, as any tool sees
//! it through the SDO server, and its own emergencies.
//!
//! | objects | what | access |
//! | --- | --- | --- |
//! | 1000h .. 1003h | device type, error register, status register, error field | ro; 1003h:00 takes 0 |
//! | 1005h, 1006h, 1007h, 1019h | SYNC | rw in pre-operational, else 08000022h |
//! | 1008h .. 100Ah, 1018h | names, versions, identity | const |
//! | 1010h, 1011h | "save", "load"; 08000022h while an axis is enabled, or if the board cannot store, when they read as 0 | rw |
//! | 1012h | TIME | rw |
//! | 1014h .. 1017h | emergencies, heartbeats | rw |
//! | 1020h, 1029h | verify configuration, error behaviour | rw |
//! | 1028h, 1200h, 1280h .. | emergency consumer, SDO server and clients | const |
//! | 1400h .., 1600h .., 1804h .., 1A04h .. | the mirror of the nodes' PDOs | const |
//! | 1800h .. 1803h, 1A00h .. 1A03h | TPDOs of the device's own: off until bit 31 of the COB-ID is cleared; the transmission type, the number of SYNCs between two, is not less than the cycle has room for. Neither is saved by 1010h | rw, mapping const |
//! | 1F22h | concise DCF of each node, as it is written to it | const |
//! | 1F25h | "conf": configure a node again | wo |
//! | 1F26h, 1F27h, 1F84h .. 1F88h, 1F8Ah | what each node has to be | const |
//! | 1F80h, 1F81h, 1F89h | NMT start-up, slave assignment, boot time | rw |
//! | 1F82h | request NMT; reads what the node last said; of the device itself 08000022h while an axis is enabled | rw |
//! | 2000h .. 2010h | the group of axes: see [`Panel`](crate::motion::panel::Panel) | |
//! | 2F00h:n | error status of the boot-up of node n: a letter of CiA 302-2, 0 for none | ro, U8 |
//! | 2F01h:n | boot-up of node n in words | ro, string |
//! | 2F02h:n | newest emergency of node n in words | ro, string |
//! | 2F10h | the master's clock; 08000024h before it is set | rw, TIME_OF_DAY |
//! | 2F11h | period of TIME in milliseconds, 0 = off | rw, U16 |
//! | 2F12h | transfers test data to or from a node by SDO: see [`TransferTest`] | |
//! | 2F80h + n | emergencies of node n: count (0 clears), then the eight bytes of each, newest first | U64 |
//! | 3000h + n | process data of node n: what it sends, then what it receives, as mapped | ro |
//!
//! What follows from the design of the network is constant: writing it is
//! answered with 06010002h. It is computed from [`Network`], not stored.

mod dictionary;
mod error;
mod index;
mod lookup;
mod node_record;
mod own_tpdo;
mod pdo;
mod settings;
mod table;
mod transfer;
mod view;
mod window;

pub use error::MasterError;
pub use settings::{Setting, Settings};
pub use transfer::TransferTest;

use crate::boot::{self, Startup};
use crate::design::OWN_BLOCK;
use crate::emcy::{self, Emcy, EmcyCode};
use crate::frame::{Frame, MAX_DATA};
use crate::id::{Address, NodeId};
use crate::network::Network;
use crate::nmt::{NodeControl, Service, State, Target};
use crate::od::{Chunk, Entry, Part};
use crate::sdo::{AbortCode, Server};
use crate::sync::SyncLimits;
use crate::time::{Duration, Instant};
use crate::time_of_day::{self, TimeOfDay};
use dictionary::Dictionary;
use node_record::{NodeRecord, Presence};
use own_tpdo::OwnTpdos;
use view::View;

/// What the board is called.
#[derive(Clone, Copy, Debug)]
pub struct Description {
    /// 1000h: 0 for a device without profile.
    pub device_type: u32,
    /// 1008h
    pub name: &'static str,
    /// 1009h
    pub hardware: &'static str,
    /// 100Ah
    pub software: &'static str,
    /// 1018h
    pub identity: Identity,
    /// What the device can do of 1006h and 1007h.
    pub sync: SyncLimits,
    /// The least transmission type that the cycle has room for in the device's own
    /// TPDOs: SYNCs from one to the next, while all four are sent.
    pub tpdo_every: u8,
}

/// The identity object, 1018h (CiA 301, 7.5.2.21).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Vendor-ID as CiA assigns it; 0 where none was.
    pub vendor: u32,
    /// Product code.
    pub product: u32,
    /// Revision number, major in the high word.
    pub revision: u32,
    /// Serial number.
    pub serial: u32,
}

/// What the dictionary needs of the rest of the device.
pub trait Board {
    /// Stores the settings, so that they survive power-off; an empty set means
    /// the design's own. Called while no axis is enabled.
    ///
    /// # Errors
    /// 06060000h if it failed.
    fn save(&mut self, settings: &[u8]) -> Result<(), AbortCode>;

    /// Whether this board can store anything at all: else 1010h and 1011h read as
    /// 0 and refuse with 08000022h.
    fn can_save(&self) -> bool;

    /// Whether an NMT command that a client requests (1F82h), or the reset that
    /// configures a node again (1F25h), would be carried out now.
    ///
    /// # Errors
    /// What the client is told: 08000022h if it would not.
    fn may_request(&mut self, control: NodeControl) -> Result<(), AbortCode>;

    /// The value of an entry that the board answers for; 2F20h: what it measures of
    /// itself. Of a signed entry the bits.
    ///
    /// # Errors
    /// What the client is told.
    fn number(&mut self, at: Address) -> Result<u32, AbortCode> {
        let _ = at;
        Ok(0)
    }

    /// An entry that the board answers for was written to; 2F20h: what it holds begins
    /// anew.
    ///
    /// # Errors
    /// What the client is told.
    fn set_number(&mut self, at: Address, value: u32) -> Result<(), AbortCode> {
        let _ = (at, value);
        Ok(())
    }

    /// As [`ObjectDictionary::read`](crate::od::ObjectDictionary::read), of an entry that the board answers for.
    ///
    /// # Errors
    /// 06010000h unless implemented.
    fn read(&mut self, at: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        let _ = (at, offset, buf);
        Err(AbortCode::UNSUPPORTED_ACCESS)
    }

    /// As [`ObjectDictionary::write`](crate::od::ObjectDictionary::write), of an entry that the board answers for.
    ///
    /// # Errors
    /// 06010000h unless implemented.
    fn write(&mut self, at: Address, part: Part<'_>) -> Result<(), AbortCode> {
        let _ = (at, part);
        Err(AbortCode::UNSUPPORTED_ACCESS)
    }

    /// As [`ObjectDictionary::cancel`](crate::od::ObjectDictionary::cancel), of an entry that the board answers for.
    fn cancel(&mut self, at: Address) {
        let _ = at;
    }

    /// The bytes of a TPDO of a node as it last came, zeros before.
    fn tpdo(&mut self, node: NodeId, number: u8) -> [u8; MAX_DATA];

    /// The bytes of an RPDO of a node as it was last sent, zeros before, and while
    /// another is sent in its place.
    fn rpdo(&mut self, node: NodeId, number: u8) -> [u8; MAX_DATA];
}

/// What a client caused, for the caller to carry out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Event {
    /// A setting has changed: what uses it has to take it over from
    /// [`Device::settings`].
    Changed(Setting),
    /// 1F82h: this command is to be sent, and obeyed where it is meant for the
    /// master itself.
    Nmt(NodeControl),
    /// 1F25h: these nodes are to be configured again.
    Configure(Target),
}

/// The node side of a master of at most `N` nodes: SDO server, object
/// dictionary, emergencies, TIME. Heartbeat and NMT state machine are
/// [`nmt::Producer`](crate::nmt::Producer) and [`nmt::Node`](crate::nmt::Node).
#[derive(Debug)]
pub struct Device<const N: usize> {
    server: Server,
    dictionary: Dictionary<N>,
    time: time_of_day::Producer,
}

impl<const N: usize> Device<N> {
    /// The device with the settings of the network's design. An SDO transfer
    /// that stands still for `timeout` is aborted.
    pub fn new(
        description: Description,
        network: &'static Network,
        timeout: Duration,
    ) -> Device<N> {
        Device {
            server: Server::new(network.master.node, timeout).with_block_size(OWN_BLOCK),
            dictionary: Dictionary {
                description,
                network,
                settings: Settings::new(network),
                is_master: true,
                errors: emcy::Producer::new(),
                state: State::Initialising,
                status: 0,
                axes_enabled: false,
                clock: time_of_day::Clock::new(),
                nodes: [const { NodeRecord::NONE }; N],
                transfer: TransferTest::NONE,
                own_tpdos: OwnTpdos::new(description.tpdo_every),
                events: heapless::Deque::new(),
            },
            time: time_of_day::Producer::new(),
        }
    }

    /// Takes over the settings that were saved, after power-on and on NMT reset
    /// communication; `&[]` for the design's own. What this version does not
    /// know or accept keeps the design's value.
    pub fn load(&mut self, saved: &[u8], now: Instant) {
        let dictionary = &mut self.dictionary;
        let limits = dictionary.description.sync;
        let producing = dictionary.settings.sync().cob_id().is_producer();
        dictionary.settings = Settings::decode(dictionary.network, saved, &limits);
        dictionary.is_master = dictionary.settings.startup().has(Startup::MASTER);
        dictionary.settings.set_sync_producer(producing);
        self.start_time(now);
    }

    /// Type and access of an entry of the dictionary, as an EDS of the device has
    /// to tell them.
    ///
    /// # Errors
    /// 06020000h if the object, 06090011h if the sub-index does not exist.
    pub fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        self.dictionary.entry(at)
    }

    /// The settings in force.
    pub const fn settings(&self) -> &Settings<N> {
        &self.dictionary.settings
    }

    /// The NMT state of the device. A transfer ends where SDO is no longer
    /// allowed.
    pub fn set_state(&mut self, state: State, board: &mut impl Board, now: Instant) {
        self.dictionary.state = state;
        if !state.allows(Service::Sdo) {
            let view = &mut View::new(&mut self.dictionary, board, now);
            self.server.reset(view);
        }
    }

    /// Bit 30 of 1005h, where the device itself switches the SYNC.
    pub fn set_sync_producer(&mut self, on: bool) {
        self.dictionary.settings.set_sync_producer(on);
    }

    /// 1002h, the manufacturer status register.
    pub fn set_status(&mut self, status: u32) {
        self.dictionary.status = status;
    }

    /// While an axis is enabled nothing is saved.
    pub fn set_axes_enabled(&mut self, enabled: bool) {
        self.dictionary.axes_enabled = enabled;
    }

    /// 2F12h: what is to be transferred, if it is under way.
    pub const fn transfer(&mut self) -> &mut TransferTest {
        &mut self.dictionary.transfer
    }

    /// SYNCs have been sent: own TPDOs may be due, which [`poll`](Self::poll) makes.
    pub fn on_syncs(&mut self, count: u32) {
        for _ in 0..count {
            self.dictionary.own_tpdos.on_sync();
        }
    }

    /// Whether any of the device's own TPDOs is switched on: then it has to be told of
    /// SYNCs in time.
    pub const fn sends_tpdos(&self) -> bool {
        self.dictionary.own_tpdos.any()
    }

    /// Takes note of a step of the boot-up: 2F00h, 2F01h.
    pub fn on_boot_event(&mut self, event: &boot::Event) {
        self.dictionary.on_boot_event(event);
    }

    /// Takes note of an emergency of a node: 2F02h, 2F80h.
    pub fn on_emcy(&mut self, node: NodeId, emcy: Emcy) {
        if let Some(record) = self.dictionary.record(node) {
            record.emcy.push(emcy);
        }
    }

    /// Takes note of what error control tells of a node: 1F82h. `None`: it was
    /// lost.
    pub fn on_node_state(&mut self, node: NodeId, state: Option<State>) {
        if let Some(record) = self.dictionary.record(node) {
            record.presence = state.map_or(Presence::MISSING, Presence::state);
        }
    }

    /// An error of the master has come: 1001h, 1003h, and an emergency.
    pub fn raise(&mut self, error: MasterError) {
        self.dictionary.errors.raise(error.emcy());
    }

    /// An error of the master has gone; it is told with the same facts as when
    /// it came.
    pub fn clear(&mut self, error: MasterError) {
        self.dictionary.errors.clear(error.emcy());
    }

    /// All errors with this code have gone, or those of a node alone.
    pub fn clear_all(&mut self, code: EmcyCode, node: Option<NodeId>) {
        self.dictionary.errors.clear_all(&|error| {
            let [about, ..] = error.manufacturer;
            error.code == code && node.is_none_or(|node| node.get() == about)
        });
    }

    /// Whether the device was the NMT master (1F80h, bit 0) when its settings were
    /// loaded: a change of that bit takes effect at the next start.
    pub const fn is_master(&self) -> bool {
        self.dictionary.is_master
    }

    /// The NMT state of the device.
    pub const fn state(&self) -> State {
        self.dictionary.state
    }

    /// Whether an axis is enabled, as [`set_axes_enabled`](Self::set_axes_enabled)
    /// told it last.
    pub const fn axes_enabled(&self) -> bool {
        self.dictionary.axes_enabled
    }

    /// What a client caused: to be called until it returns `None`, after every
    /// frame.
    pub fn take_event(&mut self) -> Option<Event> {
        self.dictionary.events.pop_front()
    }

    /// Takes in a frame: a request to the SDO server, answered unless the NMT
    /// state forbids it, or TIME.
    #[inline(never)]
    pub fn on_frame(
        &mut self,
        frame: &Frame,
        now: Instant,
        board: &mut impl Board,
    ) -> Option<Frame> {
        let state = self.dictionary.state;
        if state.allows(Service::Time) {
            self.on_time(frame, now);
        }
        if !state.allows(Service::Sdo) {
            return None;
        }
        let before = self.time_period();
        let view = &mut View::new(&mut self.dictionary, board, now);
        let answer = self.server.on_frame(frame, now, view);
        if self.time_period() != before {
            self.start_time(now);
        }
        answer
    }

    /// Lets time pass: to be called until it returns `None`, or until there is
    /// no room for another frame.
    #[inline(never)]
    pub fn poll(&mut self, now: Instant, board: &mut impl Board) -> Option<Frame> {
        let dictionary = &mut self.dictionary;
        dictionary.clock.advance(now);
        let settings = &dictionary.settings;
        let emcy = dictionary.errors.poll(
            now,
            dictionary.state,
            settings.emcy_cob_id(),
            settings.emcy_inhibit(),
        );
        if emcy.is_some() {
            return emcy;
        }
        if let Some(id) = settings.time_cob_id().id()
            && dictionary.state.allows(Service::Time)
            && let Some(time) = self.time.poll(now, &dictionary.clock, id)
        {
            return Some(time);
        }
        let pdos = dictionary.state.allows(Service::Pdo);
        let view = &mut View::new(dictionary, board, now);
        let tpdo = if pdos { view.own_tpdo() } else { None };
        tpdo.or_else(|| self.server.poll(now, view))
    }

    /// When [`poll`](Self::poll) has something to do, if the NMT state allows
    /// it.
    pub fn next_deadline(&self) -> Option<Instant> {
        let state = self.dictionary.state;
        let mut next = Instant::of(self.server.next_deadline());
        if state.allows(Service::Emergency) {
            next = next.min(Instant::of(self.dictionary.errors.next_deadline()));
        }
        if state.allows(Service::Time) {
            next = next.min(Instant::of(self.time.next_deadline()));
        }
        next.deadline()
    }

    /// How often TIME is produced; zero: not at all.
    fn time_period(&self) -> Duration {
        let settings = &self.dictionary.settings;
        match settings.time_cob_id().is_producer() {
            true => settings.time_period(),
            false => Duration::ZERO,
        }
    }

    fn start_time(&mut self, now: Instant) {
        self.time.set_period(self.time_period(), now);
    }

    fn on_time(&mut self, frame: &Frame, now: Instant) {
        let cob_id = self.dictionary.settings.time_cob_id();
        if let Some(id) = cob_id.id()
            && cob_id.is_consumer()
            && let Some(time) = TimeOfDay::from_frame(frame, id)
        {
            self.dictionary.clock.set(time, now);
        }
    }
}
