//! The object dictionary of one drive: the values of [`objects`](super::objects)
//! and the rules that go beyond type, access and range.

use super::config::Identity;
use super::errors::Errors;
use super::modes::Mode;
use super::objects::{GUARD_TIME, LIFE_TIME_FACTOR, OBJECT_COUNT, TABLE};
use super::store::{self, UNCONFIGURED};
use super::test_data::{self, TestData};
use super::{bit_rate, pdo};
use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::od::{Chunk, Entry, ObjectDictionary, Part, Value, Values};
use canmaster::sdo::AbortCode;

/// "save", as 1010h wants it.
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// "load", as 1011h wants it.
const LOAD: u32 = u32::from_le_bytes(*b"load");
/// Objects that a reset of the communication sets back.
const COMMUNICATION_AREA: (u16, u16) = (0x1000, 0x1FFF);
/// rpm, without prefix (60A9h).
const UNIT_RPM: u32 = 0x00B4_4700;
const HOMING_METHODS: [i8; 15] = [37, 34, 33, 27, 23, 18, 17, 11, 7, 2, 1, -1, -2, -3, -4];
/// DC, sinusoidal PM, trapezoidal PM (6402h).
const MOTOR_TYPES: [u16; 3] = [1, 10, 11];

/// The dictionary.
#[derive(Clone, Debug)]
pub struct Dictionary {
    values: Values<OBJECT_COUNT>,
    /// What the next reset loads: the factory's values or those saved.
    stored: Values<OBJECT_COUNT>,
    /// The node-ID in use.
    node: Option<NodeId>,
    /// What the switches of the drive say; they go before 2000h.
    pub switches: Option<NodeId>,
    identity: Identity,
    /// 100Ch and 100Dh exist.
    guarding: bool,
    /// The memory for 1010h is broken.
    pub store_fails: bool,
    /// Behind 2FF0h, which exists only with it.
    pub test_data: Option<TestData>,
    /// Behind 1001h, 1003h and 603Fh.
    pub errors: Errors,
    /// Mappings cannot be changed then.
    pub operational: bool,
    /// Entries whose next writing is refused, for tests of the master.
    pub refused: Vec<(Address, AbortCode)>,
    written: Vec<Address>,
}

impl Dictionary {
    /// With the factory's values. `node` is what 2000h holds.
    pub fn new(node: Option<NodeId>, identity: Identity, guarding: bool) -> Dictionary {
        let stored = store::factory(node, identity);
        Dictionary {
            values: stored.clone(),
            stored,
            node: None,
            switches: None,
            identity,
            guarding,
            store_fails: false,
            test_data: None,
            errors: Errors::default(),
            operational: false,
            refused: Vec::new(),
            written: Vec::new(),
        }
    }

    /// It is another device, from now on.
    pub fn set_identity(&mut self, identity: Identity) {
        self.identity = identity;
        for values in [&mut self.values, &mut self.stored] {
            store::put_identity(values, identity);
        }
    }

    /// Who it says it is.
    pub fn identity(&self) -> Identity {
        self.identity
    }

    /// The node-ID in use.
    pub fn node(&self) -> Option<NodeId> {
        self.node
    }

    /// The node-ID that the next reset of the communication brings into use.
    pub fn pending_node(&self) -> Option<NodeId> {
        let set = NodeId::new(self.number(0x2000, 0) as u8);
        self.switches.or(set)
    }

    /// A node-ID comes into use, or is taken away: identifiers of the
    /// predefined connection set follow it, others stay.
    pub fn use_node(&mut self, node: Option<NodeId>) {
        for values in [&mut self.values, &mut self.stored] {
            store::renumber(values, node);
        }
        self.node = node;
    }

    /// LSS gives a node-ID, or takes it away.
    pub fn set_pending_node(&mut self, node: Option<NodeId>) {
        self.put(0x2000, 0, node.map_or(UNCONFIGURED, NodeId::get).into());
    }

    /// LSS store configuration: 2000h and 2001h alone.
    ///
    /// # Errors
    /// The memory is broken.
    pub fn store_layer(&mut self) -> Result<(), AbortCode> {
        check(!self.store_fails, AbortCode::HARDWARE)?;
        for index in [0x2000, 0x2001] {
            let number = self.number(index, 0);
            self.stored.put(index, 0, number);
        }
        Ok(())
    }

    /// NMT reset node, power-on: everything is loaded from the store. The
    /// history of errors is kept.
    pub fn reset_node(&mut self) {
        self.values = self.stored.clone();
        self.errors.reset();
        self.errors.communication_reset();
        self.written.clear();
    }

    /// NMT reset communication: 1000h..1FFFh are loaded from the store.
    pub fn reset_communication(&mut self) {
        let (from, to) = COMMUNICATION_AREA;
        for object in TABLE.objects() {
            let (index, sub) = (object.at.index.0, object.at.sub.0);
            if (from..=to).contains(&index) {
                self.values.put(index, sub, self.stored.number(index, sub));
            }
        }
        self.errors.communication_reset();
    }

    /// The value of an entry; 0 for one that does not exist.
    pub fn number(&self, index: u16, sub: u8) -> i64 {
        self.values.number(index, sub)
    }

    /// Sets a value from within the drive.
    pub fn put(&mut self, index: u16, sub: u8, number: i64) {
        let exists = self.values.put(index, sub, number);
        debug_assert!(exists, "{index:04X}h:{sub:02X} is in the table");
    }

    /// A speed of the dictionary in rpm (60A9h).
    pub fn rpm(&self, index: u16, sub: u8) -> f64 {
        self.number(index, sub) as f64 * self.velocity_unit()
    }

    /// rpm per velocity unit: a power of ten.
    pub fn velocity_unit(&self) -> f64 {
        let prefix = (self.number(0x60A9, 0) as u32 >> 24) as u8 as i8;
        10f64.powi(i32::from(prefix))
    }

    /// The entries written since the last call, in order.
    pub fn take_written(&mut self) -> Vec<Address> {
        std::mem::take(&mut self.written)
    }

    /// The rules of single objects, and the new value.
    fn accept(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        let number = value.as_u32();
        let (index, sub) = (at.index.0, at.sub.0);
        match index {
            0x1003 => {
                check(number == 0, AbortCode::VALUE_RANGE)?;
                self.errors.clear_history();
                return Ok(());
            }
            0x1010 => {
                check(number == SAVE, AbortCode::CANNOT_STORE)?;
                check(!self.store_fails, AbortCode::HARDWARE)?;
                store::save(&self.values, &mut self.stored);
                return Ok(());
            }
            0x1011 => {
                check(number == LOAD, AbortCode::CANNOT_STORE)?;
                check(!self.store_fails, AbortCode::HARDWARE)?;
                self.stored = store::restored(&self.stored, self.identity);
                return Ok(());
            }
            0x1016 => self.check_consumer(sub, number)?,
            0x2000 => check(
                NodeId::new(value.as_u8()).is_some() || value.as_u8() == UNCONFIGURED,
                AbortCode::VALUE_RANGE,
            )?,
            0x2001 => check(bit_rate::exists(value.as_u8()), AbortCode::VALUE_RANGE)?,
            0x6060 => {
                check(
                    Mode::from_code(value.as_i32() as i8).is_some(),
                    AbortCode::VALUE_RANGE,
                )?;
            }
            0x6098 => listed(&HOMING_METHODS, value.as_i32() as i8)?,
            0x6402 => listed(&MOTOR_TYPES, value.as_u16())?,
            0x60A9 => check(velocity_unit_allowed(number), AbortCode::VALUE_RANGE)?,
            _ => pdo::check(self, self.node, at, number)?,
        }
        self.values.put(index, sub, value.as_i64());
        Ok(())
    }

    /// 1016h: a node is watched once (CiA 301, 7.5.2.19).
    fn check_consumer(&self, sub: u8, number: u32) -> Result<(), AbortCode> {
        let other = self.number(0x1016, if sub == 1 { 2 } else { 1 }) as u32;
        let (node, time) = (number >> 16 & 0xFF, number & 0xFFFF);
        let same = time != 0 && other & 0xFFFF != 0 && other >> 16 & 0xFF == node;
        check(!same, AbortCode::PARAMETER_INCOMPATIBLE)?;
        let known = time == 0 || node <= u32::from(NodeId::MAX.get());
        check(known, AbortCode::VALUE_RANGE)
    }
}

impl ObjectDictionary for Dictionary {
    fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        let guard = matches!(at.index.0, GUARD_TIME | LIFE_TIME_FACTOR);
        let test = at.index.0 == test_data::INDEX;
        let exists = (self.guarding || !guard) && (self.test_data.is_some() || !test);
        check(exists, AbortCode::NO_SUCH_OBJECT)?;
        self.values.entry(at)
    }

    fn get(&mut self, at: Address) -> Result<Value, AbortCode> {
        let sub = at.sub.0;
        Ok(match at.index.0 {
            0x1001 => self.errors.register().into(),
            0x1003 if sub == 0 => self.errors.count().into(),
            0x1003 => u32::from(self.errors.entry(sub).unwrap_or(0)).into(),
            0x603F => self.errors.last().into(),
            _ => return self.values.get(at),
        })
    }

    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        if let Some((_, code)) = self.refused.iter().find(|(entry, _)| *entry == at) {
            return Err(*code);
        }
        self.accept(at, value)?;
        self.written.push(at);
        Ok(())
    }

    fn read(&mut self, at: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        match &self.test_data {
            Some(test) if at.index.0 == test_data::INDEX => Ok(test.read(offset, buf)),
            _ => self.values.read(at, offset, buf),
        }
    }

    fn write(&mut self, at: Address, part: Part<'_>) -> Result<(), AbortCode> {
        match &mut self.test_data {
            Some(test) if at.index.0 == test_data::INDEX => test.write(part),
            _ => Err(AbortCode::UNSUPPORTED_ACCESS),
        }
    }
}

/// The dictionary as an RPDO writes it: what an entry does not accept is passed
/// over by the caller, since a PDO has no answer, and refusals that a test
/// ordered are for SDO only.
pub(super) struct ByPdo<'a>(pub(super) &'a mut Dictionary);

impl ObjectDictionary for ByPdo<'_> {
    fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        self.0.entry(at)
    }

    fn get(&mut self, at: Address) -> Result<Value, AbortCode> {
        self.0.get(at)
    }

    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        self.0.accept(at, value)?;
        self.0.written.push(at);
        Ok(())
    }
}

fn check(good: bool, code: AbortCode) -> Result<(), AbortCode> {
    if good { Ok(()) } else { Err(code) }
}

fn listed<T: PartialEq>(list: &[T], value: T) -> Result<(), AbortCode> {
    check(list.contains(&value), AbortCode::VALUE_RANGE)
}

fn velocity_unit_allowed(number: u32) -> bool {
    let prefix = (number >> 24) as u8 as i8;
    number & 0x00FF_FFFF == UNIT_RPM && (-6..=0).contains(&prefix)
}
