//! The dictionary as the SDO server sees it: values of its entries, and what
//! writing them does.

use super::Board;
use super::Event;
use super::dictionary::Dictionary;
use super::lookup::Found;
use super::node_record::{NO_EMERGENCY, NOT_IN_THE_NETWORK};
use super::own_tpdo;
use super::pdo::Mirrored;
use super::settings::RESTORE_ALL;
use super::table::Item;
use super::window::{Window, concise_dcf};
use crate::emcy::EmcyCobId;
use crate::frame::{Frame, MAX_DATA};
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::network;
use crate::nmt::{Command, NodeControl, Target};
use crate::od::{Access, Chunk, DataType, Entry, ObjectDictionary, Part, Value};
use crate::pdo::Direction;
use crate::sdo::AbortCode;
use crate::time::Instant;
use crate::time_of_day::TimeOfDay;

/// Signatures of 1010h, 1011h and 1F25h, "save", "load" and "conf" from the
/// least significant byte on.
const SAVE: u32 = 0x6576_6173;
const LOAD: u32 = 0x6461_6F6C;
const CONFIGURE: u32 = 0x666E_6F63;
/// Bit 31 of a COB-ID: there is none.
const NOT_USED: u32 = 1 << 31;

/// The dictionary in the hands of the SDO server, at a moment.
pub(super) struct View<'a, B, const N: usize> {
    dictionary: &'a mut Dictionary<N>,
    board: &'a mut B,
    now: Instant,
}

impl<'a, B: Board, const N: usize> View<'a, B, N> {
    pub(super) const fn new(
        dictionary: &'a mut Dictionary<N>,
        board: &'a mut B,
        now: Instant,
    ) -> View<'a, B, N> {
        View {
            dictionary,
            board,
            now,
        }
    }

    /// The bytes of the value of the entry that was found, of fixed size.
    fn value(&mut self, at: Address, found: &Found) -> Result<u64, AbortCode> {
        let dictionary = &*self.dictionary;
        let network = dictionary.network;
        let known = found.node.and_then(|id| dictionary.node(id));
        let record = known.map(|(_, record)| record);
        let number: u32 = match found.item {
            Item::Highest => found.sub.into(),
            Item::Setting => dictionary.settings.get(found.setting),
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
            Item::PdoCobId | Item::PdoTransmission | Item::PdoMapping => {
                let mirrored = Mirrored::find(network, found.at);
                let mirrored = mirrored.ok_or(AbortCode::NO_SUCH_OBJECT)?;
                match found.item {
                    Item::PdoCobId => mirrored.cob_id(),
                    Item::PdoTransmission => mirrored.pdo.transmission.code().into(),
                    _ => {
                        let entry = mirrored.mapped(found.sub);
                        entry.ok_or(AbortCode::NO_SUCH_SUB_INDEX)?.0
                    }
                }
            }
            Item::OwnTpdo => {
                let node = network.master.node;
                dictionary.own_tpdos.get(found.place, found.sub, node)
            }
            Item::OwnMapping => {
                let entry = own_tpdo::mapped(found.place, found.sub, network.nodes.len());
                entry.ok_or(AbortCode::NO_SUCH_SUB_INDEX)?.0
            }
            Item::Zero => 0,
            Item::NmtRequest if found.node == Some(network.master.node) => {
                dictionary.state.code().into()
            }
            Item::NmtRequest => record.map_or(0, |record| record.presence.0).into(),
            Item::Expected => {
                let expected = known.and_then(|(node, _)| node.number(found.place as u8));
                expected.unwrap_or(0)
            }
            Item::ConfiguredAt => known
                .and_then(|(node, _)| node.configured.get(usize::from(found.place)))
                .copied()
                .unwrap_or(0),
            Item::RestoreConfiguration => known.map_or(0, |_| RESTORE_ALL).into(),
            Item::BootLetter => record.map_or(0, |record| record.status.letter).into(),
            Item::EmcyCount => record.map_or(0, |record| record.emcy.len() as u32),
            Item::EmcyHistory => {
                let emcy = record.and_then(|record| record.emcy.get(found.n()));
                return Ok(u64::from_le_bytes(emcy.ok_or(AbortCode::NO_DATA)?.encode()));
            }
            Item::Clock => {
                let time = dictionary.clock.time(self.now).ok_or(AbortCode::NO_DATA)?;
                return Ok(time.number());
            }
            Item::TransferTest => dictionary.transfer.word(found.n()),
            Item::Board => self.board.number(at)?,
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

impl<B: Board, const N: usize> View<'_, B, N> {
    /// The board's own TPDO that is due, with the values of this moment.
    pub(super) fn own_tpdo(&mut self) -> Option<Frame> {
        let network = self.dictionary.network;
        let n = self.dictionary.own_tpdos.take_due()?;
        let mut data = [0; MAX_DATA];
        let mut length = 0;
        for sub in 1.. {
            let Some(entry) = own_tpdo::mapped(n, sub, network.nodes.len()) else {
                break;
            };
            let bytes = self.get(entry.at()).ok()?.padded();
            let size = usize::from(entry.bits() / u8::BITS as u8);
            for (to, from) in data.iter_mut().skip(length).zip(bytes).take(size) {
                *to = from;
            }
            length += size;
        }
        let id = own_tpdo::id(n, network.master.node);
        Some(Frame::of_padded(id, length as u8, data))
    }
}

impl<B: Board, const N: usize> ObjectDictionary for View<'_, B, N> {
    fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        self.dictionary.entry(at)
    }

    fn kind(&mut self, at: Address) -> Result<(DataType, Access), AbortCode> {
        let mut found = Found::NOTHING;
        self.dictionary.find(at, &mut found)?;
        Ok((found.data_type, found.access))
    }

    /// The ranges of the settings are theirs to check.
    fn in_range(&self, _: Address, _: Value) -> Result<(), AbortCode> {
        Ok(())
    }

    fn get(&mut self, at: Address) -> Result<Value, AbortCode> {
        let mut found = Found::NOTHING;
        self.dictionary.find(at, &mut found)?;
        let value = self.value(at, &found)?;
        Ok(Value::new(found.data_type, value as i64))
    }

    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        let dictionary = &mut *self.dictionary;
        let bytes = u64::from_le_bytes(value.padded());
        let number = bytes as u32;
        let mut found = Found::NOTHING;
        dictionary.find(at, &mut found)?;
        // 80h, all nodes, is not a node-ID.
        let node = found.node;
        let target = node.map_or(Target::All, Target::Node);
        match found.item {
            Item::Setting => return dictionary.change(found.setting, number),
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
            Item::Board => return self.board.set_number(at, number),
            Item::OwnTpdo => {
                let master = dictionary.network.master.node;
                let (n, sub) = (found.place, found.sub);
                return dictionary.own_tpdos.set(n, sub, master, number);
            }
            Item::TransferTest => return dictionary.set_transfer_word(found.n(), number),
            Item::Clock => {
                let time = TimeOfDay::of_number(bytes);
                let time = time.ok_or(AbortCode::VALUE_RANGE)?;
                dictionary.clock.set(time, self.now);
            }
            _ => return Err(AbortCode::READ_ONLY),
        }
        Ok(())
    }

    fn read(&mut self, at: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        let dictionary = &*self.dictionary;
        let mut found = Found::NOTHING;
        dictionary.find(at, &mut found)?;
        let known = found.node.and_then(|id| dictionary.node(id));
        let description = &dictionary.description;
        let window = &mut Window::new(offset, buf);
        match (found.item, known) {
            (Item::DeviceName, _) => window.text(description.name),
            (Item::HardwareVersion, _) => window.text(description.hardware),
            (Item::SoftwareVersion, _) => window.text(description.software),
            (Item::ConciseDcf, Some((node, _))) => {
                let network = dictionary.network;
                concise_dcf(|| network::plan(network, node), window);
            }
            (Item::ConciseDcf, None) => return Err(AbortCode::NO_DATA),
            (Item::BootWords | Item::EmcyWords, None) => window.packed(NOT_IN_THE_NETWORK),
            (Item::BootWords, Some((node, record))) => {
                window.text(node.name);
                window.text(": ");
                record.status.write(window);
            }
            (Item::EmcyWords, Some((_, record))) => match record.emcy.get(0) {
                Some(emcy) => {
                    window.hexadecimal(emcy.code.0);
                    window.text("h (");
                    window.spell(&emcy.code.packed_text());
                    window.text(")");
                }
                None => window.packed(NO_EMERGENCY),
            },
            (Item::Board, _) => return self.board.read(at, offset, buf),
            _ => return Err(AbortCode::UNSUPPORTED_ACCESS),
        }
        Ok(window.chunk())
    }

    /// Of the entries without a fixed size only the board's can be written.
    fn write(&mut self, at: Address, part: Part<'_>) -> Result<(), AbortCode> {
        self.board.write(at, part)
    }

    fn cancel(&mut self, at: Address) {
        self.board.cancel(at);
    }
}
