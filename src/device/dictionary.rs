//! The dictionary itself: from an entry to its value and back.

use super::node_record::{NodeRecord, NodeStatus};
use super::pdo::{Mirrored, Process};
use super::settings::{RESTORE_ALL, Setting, Settings, nodes};
use super::table::{Item, Row, TABLE};
use super::window::{Window, concise_dcf};
use super::{Board, Description, Event};
use crate::emcy::{self, EmcyCobId};
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::network::{self, Network, Node};
use crate::nmt::{Command, NodeControl, State, Target};
use crate::od::{Access, Chunk, DataType, Entry, ObjectDictionary, Value, read_bytes};
use crate::pdo::Direction;
use crate::sdo::AbortCode;
use crate::store;
use crate::time::Instant;
use crate::time_of_day::{Clock, TimeOfDay};
use heapless::Deque;

/// Events that may wait. One SDO write causes one; they are fetched after each.
const EVENTS: usize = 4;

/// Signatures of 1010h, 1011h and 1F25h, "save", "load" and "conf" from the
/// least significant byte on.
const SAVE: u32 = 0x6576_6173;
const LOAD: u32 = 0x6461_6F6C;
const CONFIGURE: u32 = 0x666E_6F63;
/// Bit 31 of a COB-ID: there is none.
const NOT_USED: u32 = 1 << 31;

/// Values and state behind the entries.
#[derive(Debug)]
pub(super) struct Dictionary<const N: usize> {
    pub(super) description: Description,
    pub(super) network: &'static Network,
    pub(super) settings: Settings<N>,
    /// 1F80h, bit 0, as it was when the device started.
    pub(super) is_master: bool,
    pub(super) errors: emcy::Producer,
    pub(super) state: State,
    pub(super) status: u32,
    pub(super) axes_enabled: bool,
    pub(super) clock: Clock,
    pub(super) nodes: [NodeRecord; N],
    /// 2F12h:01 ..= 03
    pub(super) transfer: [u32; 3],
    pub(super) events: Deque<Event, EVENTS>,
}

/// An entry, and what its value comes from.
#[derive(Clone, Copy)]
struct Found {
    item: Item,
    data_type: DataType,
    access: Access,
    sub: u8,
    /// Of the object in its row of the table.
    place: u16,
    at: u16,
}

impl Found {
    /// The node that it is about, if it is about one.
    fn node(&self) -> Option<NodeId> {
        NodeId::new(match self.item {
            Item::EmcyCount | Item::EmcyHistory | Item::Process => self.place as u8,
            _ => self.sub,
        })
    }

    /// Where in a record without gaps it is, counted from 0.
    fn n(&self) -> usize {
        usize::from(self.sub).wrapping_sub(1)
    }
}

impl<const N: usize> Dictionary<N> {
    fn find(&self, at: Address) -> Result<Found, AbortCode> {
        let (at, sub) = (at.index.0, at.sub.0);
        let mut highest = None;
        for row in &TABLE {
            let Some(place) = row.place(at) else { continue };
            let found = Found {
                item: row.item,
                data_type: row.data_type,
                access: row.access,
                sub,
                place,
                at,
            };
            let Some(last) = self.last_sub(row, &found) else {
                continue;
            };
            if (row.sub..=last).contains(&sub) {
                return Ok(self.refine(found));
            }
            highest = Some(last);
        }
        match highest {
            None => Err(AbortCode::NO_SUCH_OBJECT),
            Some(last) if sub == 0 => Ok(Found {
                item: Item::Highest,
                data_type: DataType::Unsigned8,
                access: Access::Constant,
                sub: last,
                place: 0,
                at,
            }),
            Some(_) => Err(AbortCode::NO_SUCH_SUB_INDEX),
        }
    }

    pub(super) fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        let found = self.find(at)?;
        Ok(Entry::new(found.data_type, found.access))
    }

    /// The last entry of this row that the object has; `None` if there is no such
    /// object.
    fn last_sub(&self, row: &Row, found: &Found) -> Option<u8> {
        let network = self.network;
        let last = row.last_sub;
        match found.item {
            Item::Setting(Setting::ConsumerHeartbeat(_)) => Some(nodes::<N>(network)),
            Item::SdoClient | Item::SdoClientNode => {
                let client = network.nodes.get(usize::from(found.place));
                client.map(|_| last)
            }
            Item::PdoCobId | Item::PdoTransmission => {
                Mirrored::find(network, found.at).map(|_| last)
            }
            Item::PdoMapping => {
                let mirrored = Mirrored::find(network, found.at);
                mirrored.map(|mirrored| mirrored.pdo.mapping.len() as u8)
            }
            Item::EmcyCount | Item::EmcyHistory => self.node(found.node()?).map(|_| last),
            Item::Process => self
                .node(found.node()?)
                .map(|(node, _)| Process::count(node)),
            _ => Some(last),
        }
    }

    /// What the table cannot say of an entry that exists.
    fn refine(&self, found: Found) -> Found {
        let place = || Some(self.network.find(found.node()?)?.0);
        let (item, access) = match found.item {
            Item::Setting(Setting::ConsumerHeartbeat(_)) => (
                Item::Setting(Setting::ConsumerHeartbeat(found.n() as u8)),
                found.access,
            ),
            Item::Setting(Setting::Assignment(_)) => {
                match place().filter(|place| *place < usize::from(nodes::<N>(self.network))) {
                    Some(place) => (
                        Item::Setting(Setting::Assignment(place as u8)),
                        found.access,
                    ),
                    None => (Item::Zero, Access::Constant),
                }
            }
            item => (item, found.access),
        };
        let data_type = match item {
            Item::Process => self
                .process(&found)
                .map_or(found.data_type, |process| process.data_type()),
            _ => found.data_type,
        };
        Found {
            item,
            access,
            data_type,
            ..found
        }
    }

    fn process(&self, found: &Found) -> Option<Process> {
        let (node, _) = self.node(found.node()?)?;
        Process::find(node, found.sub)
    }

    pub(super) fn node(&self, node: NodeId) -> Option<(&'static Node, &NodeRecord)> {
        let (place, node) = self.network.find(node)?;
        Some((node, self.nodes.get(place)?))
    }

    pub(super) fn record(&mut self, node: NodeId) -> Option<&mut NodeRecord> {
        let (place, _) = self.network.find(node)?;
        self.nodes.get_mut(place)
    }

    fn push(&mut self, event: Event) -> Result<(), AbortCode> {
        self.events
            .push_back(event)
            .map_err(|_| AbortCode::OUT_OF_MEMORY)
    }

    fn change(&mut self, setting: Setting, value: u32) -> Result<(), AbortCode> {
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
    fn request_nmt(
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

    fn may_request(&self, board: &mut impl Board, control: NodeControl) -> Result<(), AbortCode> {
        if !self.is_master {
            return Err(AbortCode::DEVICE_STATE);
        }
        board.may_request(control)
    }

    /// 1010h and 1011h: the device does nothing else for some 25 ms, so that no
    /// axis may be enabled meanwhile.
    fn store(
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
        if saved.is_err() {
            self.errors.raise(super::MasterError::Storage.emcy());
        } else {
            self.errors.clear(super::MasterError::Storage.emcy());
        }
        saved
    }
}

/// The dictionary in the hands of the SDO server, at a moment.
pub(super) struct View<'a, B, const N: usize> {
    pub(super) dictionary: &'a mut Dictionary<N>,
    pub(super) board: &'a mut B,
    pub(super) now: Instant,
}

impl<B: Board, const N: usize> View<'_, B, N> {
    /// The bytes of a value of fixed size.
    fn value(&mut self, found: &Found) -> Result<u64, AbortCode> {
        let dictionary = &*self.dictionary;
        let network = dictionary.network;
        let known = found.node().and_then(|id| dictionary.node(id));
        let record = known.map(|(_, record)| record);
        let pdo = || Mirrored::find(network, found.at).ok_or(AbortCode::NO_SUCH_OBJECT);
        let number: u32 = match found.item {
            Item::Highest => found.sub.into(),
            Item::Setting(setting) => dictionary.settings.get(setting),
            Item::DeviceType => dictionary.description.device_type,
            Item::ErrorRegister => dictionary.errors.register().0.into(),
            Item::Status => dictionary.status,
            Item::ErrorCount => dictionary.errors.field().len() as u32,
            Item::ErrorField => *dictionary
                .errors
                .field()
                .get(found.n())
                .ok_or(AbortCode::NO_DATA)?,
            // On command, not by itself.
            Item::Save | Item::Restore => self.board.can_save().into(),
            Item::Identity => {
                let identity = &dictionary.description.identity;
                match found.sub {
                    1 => identity.vendor,
                    2 => identity.product,
                    3 => identity.revision,
                    _ => identity.serial,
                }
            }
            Item::EmcyConsumer => known.map_or(NOT_USED, |(n, _)| EmcyCobId::predefined(n.id).0),
            Item::SdoServer => sdo_channel(found.sub, network.master.node),
            Item::SdoClient | Item::SdoClientNode => {
                let client = network.nodes.get(usize::from(found.place));
                let node = client.ok_or(AbortCode::NO_SUCH_OBJECT)?.id;
                match found.item {
                    Item::SdoClient => sdo_channel(found.sub, node),
                    _ => node.get().into(),
                }
            }
            Item::PdoCobId => pdo()?.cob_id(),
            Item::PdoTransmission => pdo()?.pdo.transmission.code().into(),
            Item::PdoMapping => {
                let entry = pdo()?.mapped(found.sub);
                entry.ok_or(AbortCode::NO_SUCH_SUB_INDEX)?.0
            }
            Item::Zero => 0,
            Item::NmtRequest if found.node() == Some(network.master.node) => {
                dictionary.state.code().into()
            }
            Item::NmtRequest => record.map_or(0, |record| record.presence.code()).into(),
            Item::Expected => {
                let identity = known.map(|(node, _)| &node.identity);
                let expected = identity.and_then(|identity| match found.place {
                    0 => identity.device_type,
                    1 => identity.vendor,
                    2 => identity.product,
                    3 => identity.revision,
                    _ => identity.serial,
                });
                expected.unwrap_or(0)
            }
            Item::ConfiguredAt => known
                .and_then(|(node, _)| node.configured.get(usize::from(found.place)))
                .copied()
                .unwrap_or(0),
            Item::RestoreConfiguration => known.map_or(0, |_| RESTORE_ALL).into(),
            Item::BootLetter => record.map_or(0, |record| record.status.letter()).into(),
            Item::EmcyCount => record.map_or(0, |record| record.emcy.len() as u32),
            Item::EmcyHistory => {
                let emcy = record.and_then(|record| record.emcy.get(found.n()));
                return Ok(u64::from_le_bytes(emcy.ok_or(AbortCode::NO_DATA)?.encode()));
            }
            Item::Clock => {
                let time = dictionary.clock.time(self.now).ok_or(AbortCode::NO_DATA)?;
                let [a, b, c, d, e, f] = time.encode();
                return Ok(u64::from_le_bytes([a, b, c, d, e, f, 0, 0]));
            }
            Item::TransferTest => self.transfer_word(found.n()),
            Item::Process => {
                let process = dictionary.process(found).ok_or(AbortCode::NO_DATA)?;
                let (node, pdo) = (process.node, process.number);
                let data = match process.direction {
                    Direction::Transmit => self.board.tpdo(node, pdo),
                    Direction::Receive => self.board.rpdo(node, pdo),
                };
                return Ok(process.extract(data));
            }
            // Strings and domains are read piece by piece, 1F25h not at all.
            Item::DeviceName
            | Item::HardwareVersion
            | Item::SoftwareVersion
            | Item::ConciseDcf
            | Item::BootWords
            | Item::EmcyWords
            | Item::Configure => return Err(AbortCode::UNSUPPORTED_ACCESS),
        };
        Ok(number.into())
    }
}

/// The identifiers of a server: client to server, server to client
/// (CiA 301, 7.5.2.33, 7.5.2.34).
fn sdo_channel(sub: u8, server: NodeId) -> u32 {
    let function = match sub {
        1 => FunctionCode::SdoRequest,
        _ => FunctionCode::SdoResponse,
    };
    CobId::of(function, server).get().into()
}

impl<B: Board, const N: usize> ObjectDictionary for View<'_, B, N> {
    fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        self.dictionary.entry(at)
    }

    /// The ranges of the settings are theirs to check.
    fn in_range(&self, _: Address, _: Value) -> Result<(), AbortCode> {
        Ok(())
    }

    fn get(&mut self, at: Address) -> Result<Value, AbortCode> {
        let found = self.dictionary.find(at)?;
        let value = self.value(&found)?;
        Ok(Value::new(found.data_type, value as i64))
    }

    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        let dictionary = &mut *self.dictionary;
        let number = value.as_u32();
        let found = dictionary.find(at)?;
        // 80h, all nodes, is not a node-ID.
        let node = found.node();
        let target = node.map_or(Target::All, Target::Node);
        match found.item {
            Item::Setting(setting) => return dictionary.change(setting, number),
            // Only 0 can be written, which clears the field.
            Item::ErrorCount | Item::EmcyCount if number != 0 => {
                return Err(AbortCode::VALUE_RANGE);
            }
            Item::ErrorCount => dictionary.errors.clear_field(),
            Item::EmcyCount => {
                if let Some(record) = node.and_then(|node| dictionary.record(node)) {
                    record.emcy.clear();
                }
            }
            Item::Save => return dictionary.store(self.board, (number, SAVE), false),
            Item::Restore => return dictionary.store(self.board, (number, LOAD), true),
            Item::NmtRequest => return dictionary.request_nmt(self.board, node, number as u8),
            Item::Configure if number != CONFIGURE => return Err(AbortCode::CANNOT_STORE),
            Item::Configure => {
                // It is configured whenever it boots.
                let command = Command::ResetCommunication;
                dictionary.may_request(self.board, NodeControl { command, target })?;
                return dictionary.push(Event::Configure(target));
            }
            Item::TransferTest => return self.set_transfer_word(found.n(), number),
            Item::Clock => {
                let bytes = value.bytes().try_into().map_err(|_| AbortCode::GENERAL)?;
                let time = TimeOfDay::decode(bytes).ok_or(AbortCode::VALUE_RANGE)?;
                dictionary.clock.set(time, self.now);
            }
            _ => return Err(AbortCode::READ_ONLY),
        }
        Ok(())
    }

    fn read(&mut self, at: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        let dictionary = &*self.dictionary;
        let found = dictionary.find(at)?;
        let known = found.node().and_then(|id| dictionary.node(id));
        let description = &dictionary.description;
        let text = match found.item {
            Item::DeviceName => description.name,
            Item::HardwareVersion => description.hardware,
            Item::SoftwareVersion => description.software,
            Item::ConciseDcf | Item::BootWords | Item::EmcyWords => {
                let mut window = Window::new(offset, buf);
                match (found.item, known) {
                    (Item::ConciseDcf, Some((node, _))) => {
                        let network = dictionary.network;
                        concise_dcf(|| network::plan(network, node), &mut window);
                    }
                    (Item::ConciseDcf, None) => return Err(AbortCode::NO_DATA),
                    (_, None) => window.text("not in the network"),
                    (Item::BootWords, Some((node, record))) => {
                        window.text(node.name);
                        window.text(": ");
                        record.status.write(&mut window);
                    }
                    (_, Some((_, record))) => match record.emcy.get(0) {
                        Some(emcy) => {
                            window.hexadecimal(emcy.code.0);
                            window.text("h (");
                            window.text(emcy.code.text());
                            window.text(")");
                        }
                        None => window.text("no emergency"),
                    },
                }
                return Ok(window.chunk());
            }
            _ => return Err(AbortCode::UNSUPPORTED_ACCESS),
        };
        Ok(read_bytes(text.as_bytes(), offset, buf))
    }
}

impl<const N: usize> Dictionary<N> {
    /// Takes note of a step of the boot-up.
    pub(super) fn on_boot_event(&mut self, event: &crate::boot::Event) {
        let Some(status) = NodeStatus::after(event) else {
            return;
        };
        match event.node() {
            Some(node) => {
                if let Some(record) = self.record(node) {
                    record.step(status);
                }
            }
            None => {
                let known = usize::from(nodes::<N>(self.network));
                for record in self.nodes.iter_mut().take(known) {
                    record.step(status);
                }
            }
        }
    }
}
