//! The dictionary itself: from an entry to its value and back.

use super::found::{Found, Item, Lookup};
use super::node_record::{NodeRecord, NodeStatus};
use super::settings::{Setting, Settings, nodes};
use super::window::{Window, concise_dcf};
use super::{Board, Description, Event, communication, index, manager, pdo};
use crate::emcy;
use crate::id::{Address, NodeId};
use crate::network::{self, Network, Node};
use crate::nmt::{Command, NodeControl, State, Target};
use crate::od::{Chunk, Entry, ObjectDictionary, Value, read_bytes};
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
/// What 1010h and 1011h read as: on command, not by itself.
const ON_COMMAND: u8 = 1;

/// Values and state behind the entries.
#[derive(Debug)]
pub(super) struct Dictionary<const N: usize> {
    pub(super) description: Description,
    pub(super) network: &'static Network,
    pub(super) settings: Settings<N>,
    pub(super) errors: emcy::Producer,
    pub(super) state: State,
    pub(super) status: u32,
    pub(super) axes_enabled: bool,
    pub(super) clock: Clock,
    pub(super) nodes: [NodeRecord; N],
    pub(super) events: Deque<Event, EVENTS>,
}

impl<const N: usize> Dictionary<N> {
    fn find(&self, at: Address) -> Lookup {
        let (index, sub) = (at.index.0, at.sub.0);
        let network = self.network;
        match index {
            index::DEVICE_TYPE..=index::SDO_CLIENTS_LAST => {
                communication::find::<N>(&self.description, network, index, sub)
            }
            index::CONCISE_DCF..=index::EMCY_HISTORY_LAST => {
                manager::find::<N>(network, index, sub)
            }
            index::PROCESS..=index::PROCESS_LAST => pdo::find_process(network, index, sub),
            _ => pdo::find(network, index, sub),
        }
    }

    fn node(&self, node: NodeId) -> Option<(&'static Node, &NodeRecord)> {
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
        let shortest = self.description.shortest_cycle_us;
        self.settings.set(setting, value, shortest)?;
        self.push(Event::Changed(setting))
    }

    /// 1F82h (CiA 302-2).
    fn request_nmt(&mut self, node: Option<NodeId>, value: u8) -> Result<(), AbortCode> {
        let command = match value {
            4 => Command::Stop,
            5 => Command::Start,
            6 => Command::ResetNode,
            7 => Command::ResetCommunication,
            127 => Command::EnterPreOperational,
            _ => return Err(AbortCode::VALUE_RANGE),
        };
        let target = node.map_or(Target::All, Target::Node);
        self.push(Event::Nmt(NodeControl { command, target }))
    }

    /// 1010h and 1011h: an erase stops the core for some 22 ms, so that no axis
    /// may be enabled meanwhile.
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
        if self.axes_enabled {
            return Err(AbortCode::DEVICE_STATE);
        }
        let mut buf = [0; store::CAPACITY];
        let len = if restore {
            0
        } else {
            self.settings.encode(self.network, &mut buf)?
        };
        board.save(buf.get(..len).unwrap_or(&[]))
    }
}

/// The dictionary in the hands of the SDO server, at a moment.
pub(super) struct View<'a, B, const N: usize> {
    pub(super) dictionary: &'a mut Dictionary<N>,
    pub(super) board: &'a mut B,
    pub(super) now: Instant,
}

impl<B: Board, const N: usize> View<'_, B, N> {
    fn value(&mut self, found: Found) -> Result<Value, AbortCode> {
        let dictionary = &*self.dictionary;
        let data_type = found.entry.data_type;
        let number = |number: u32| Ok(Value::new(data_type, i64::from(number)));
        match found.item {
            Item::Number(value) => number(value),
            Item::Setting(setting) => number(dictionary.settings.get(setting)),
            Item::ErrorRegister => number(u32::from(dictionary.errors.register().0)),
            Item::Status => number(dictionary.status),
            Item::ErrorCount => number(dictionary.errors.field().len() as u32),
            Item::ErrorField(age) => dictionary
                .errors
                .field()
                .get(usize::from(age))
                .map(|error| Value::from(*error))
                .ok_or(AbortCode::NO_DATA),
            Item::Save | Item::Restore => number(u32::from(ON_COMMAND)),
            Item::NmtRequest(node) => {
                let record = node.and_then(|node| dictionary.node(node));
                number(record.map_or(0, |(_, record)| u32::from(record.presence.code())))
            }
            Item::BootLetter(node) => {
                let letter = dictionary.node(node).map_or(0, |(_, r)| r.status.letter());
                number(u32::from(letter))
            }
            Item::EmcyCount(node) => {
                let count = dictionary.node(node).map_or(0, |(_, r)| r.emcy.len());
                number(count as u32)
            }
            Item::EmcyField(node, age) => dictionary
                .node(node)
                .and_then(|(_, record)| record.emcy.get(usize::from(age)))
                .map(|emcy| Value::from(u64::from_le_bytes(emcy.encode())))
                .ok_or(AbortCode::NO_DATA),
            Item::Clock => {
                let time = dictionary.clock.time(self.now).ok_or(AbortCode::NO_DATA)?;
                Value::from_bytes(data_type, &time.encode())
            }
            Item::Process(process) => {
                let (node, pdo) = (process.node, process.number);
                let data = match process.direction {
                    Direction::Transmit => self.board.tpdo(node, pdo),
                    Direction::Receive => self.board.rpdo(node, pdo),
                };
                let value = process.extract(data).to_le_bytes();
                let size = data_type.size().unwrap_or(value.len());
                Value::from_bytes(data_type, value.get(..size).unwrap_or(&value))
            }
            // Strings and domains are read piece by piece, 1F25h not at all.
            Item::Text(_)
            | Item::ConciseDcf(_)
            | Item::BootWords(_)
            | Item::EmcyWords(_)
            | Item::Configure(_) => Err(AbortCode::UNSUPPORTED_ACCESS),
        }
    }

    fn write_words(&self, item: Item, window: &mut Window<'_>) -> Result<(), AbortCode> {
        let dictionary = &*self.dictionary;
        match item {
            Item::BootWords(node) => match dictionary.node(node) {
                Some((known, record)) => {
                    window.text(known.name);
                    window.text(": ");
                    record.status.write(window);
                }
                None => window.text("not in the network"),
            },
            Item::EmcyWords(node) => match dictionary.node(node).map(|(_, r)| r.emcy.get(0)) {
                Some(Some(emcy)) => {
                    window.hexadecimal(emcy.code.0);
                    window.text("h (");
                    window.text(emcy.code.text());
                    window.text(")");
                }
                Some(None) => window.text("no emergency"),
                None => window.text("not in the network"),
            },
            _ => return Err(AbortCode::UNSUPPORTED_ACCESS),
        }
        Ok(())
    }
}

impl<B: Board, const N: usize> ObjectDictionary for View<'_, B, N> {
    fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        Ok(self.dictionary.find(at)?.entry)
    }

    fn get(&mut self, at: Address) -> Result<Value, AbortCode> {
        let found = self.dictionary.find(at)?;
        self.value(found)
    }

    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        let dictionary = &mut *self.dictionary;
        let number = value.as_u32();
        match dictionary.find(at)?.item {
            Item::Setting(setting) => dictionary.change(setting, number),
            Item::ErrorCount => {
                dictionary.errors.clear_field();
                Ok(())
            }
            Item::Save => dictionary.store(self.board, (number, SAVE), false),
            Item::Restore => dictionary.store(self.board, (number, LOAD), true),
            Item::NmtRequest(node) => dictionary.request_nmt(node, value.as_u8()),
            Item::Configure(node) if number == CONFIGURE => {
                dictionary.push(Event::Configure(node.map_or(Target::All, Target::Node)))
            }
            Item::Configure(_) => Err(AbortCode::CANNOT_STORE),
            Item::EmcyCount(node) => {
                if let Some(record) = dictionary.record(node) {
                    record.emcy.clear();
                }
                Ok(())
            }
            Item::Clock => {
                let bytes = value.bytes().try_into().map_err(|_| AbortCode::GENERAL)?;
                let time = TimeOfDay::decode(bytes).ok_or(AbortCode::VALUE_RANGE)?;
                dictionary.clock.set(time, self.now);
                Ok(())
            }
            _ => Err(AbortCode::READ_ONLY),
        }
    }

    fn read(&mut self, at: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        let item = self.dictionary.find(at)?.item;
        if let Item::Text(text) = item {
            return Ok(read_bytes(text.as_bytes(), offset, buf));
        }
        let mut window = Window::new(offset, buf);
        if let Item::ConciseDcf(node) = item {
            let network = self.dictionary.network;
            let (_, node) = network.find(node).ok_or(AbortCode::NO_DATA)?;
            concise_dcf(|| network::plan(network, node), &mut window);
        } else {
            self.write_words(item, &mut window)?;
        }
        Ok(window.chunk())
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
                    record.status = status;
                }
            }
            None => {
                let known = usize::from(nodes::<N>(self.network));
                for record in self.nodes.iter_mut().take(known) {
                    record.status = status;
                }
            }
        }
    }
}
