//! Every object of the dictionary in one list: indices, sub-indices, type,
//! access, and what stands behind them.
//!
//! Sub-index 0 of a record or an array is not in the list: it follows from the
//! others.

use super::index;
use super::node_record::HISTORY;
use super::own_tpdo::OWN_TPDOS;
use super::settings::Setting;
use crate::emcy::ERROR_FIELD;
use crate::id::NodeId;
use crate::motion::panel;
use crate::od::{Access, DataType};

/// Where the value of an entry comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Item {
    /// Sub-index 0 of a record or an array.
    Highest,
    /// What a client may change and 1010h saves; which one, the row's argument tells.
    Setting,
    DeviceType,
    ErrorRegister,
    Status,
    ErrorCount,
    ErrorField,
    DeviceName,
    HardwareVersion,
    SoftwareVersion,
    Save,
    Restore,
    Identity,
    EmcyConsumer,
    SdoServer,
    SdoClient,
    SdoClientNode,
    PdoCobId,
    PdoTransmission,
    PdoMapping,
    /// Parameters of the board's own TPDOs.
    OwnTpdo,
    OwnMapping,
    ConciseDcf,
    Configure,
    /// Not named by the network: 0.
    Zero,
    NmtRequest,
    /// 1F84h ..= 1F88h
    Expected,
    /// 1F26h and 1F27h
    ConfiguredAt,
    RestoreConfiguration,
    BootLetter,
    BootWords,
    EmcyWords,
    Clock,
    TransferTest,
    /// What the board answers for: [`Board::number`](super::Board::number).
    Board,
    EmcyCount,
    EmcyHistory,
    Process,
}

/// Objects of one kind, and those of their entries that are of one kind.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) first: u16,
    pub(super) sub: u8,
    pub(super) last_sub: u8,
    pub(super) data_type: DataType,
    pub(super) access: Access,
    pub(super) item: Item,
    /// Objects after the first; of settings, which one it is.
    argument: u8,
}

impl Row {
    /// The place of an object in this row.
    pub(super) fn place(&self, at: u16) -> Option<u16> {
        let more = match self.item {
            Item::Setting => 0,
            _ => self.argument,
        };
        at.checked_sub(self.first)
            .filter(|place| *place <= more.into())
    }

    /// The setting, with the number of the node that it is of.
    pub(super) const fn setting(&self, node: u8) -> Setting {
        Setting::numbered(self.argument, node)
    }

    /// Whether this is the row of a setting.
    pub(super) fn is_of(&self, setting: Setting) -> bool {
        self.item == Item::Setting && self.argument == setting.number()
    }

    /// The entries `sub ..= last_sub` of an object.
    const fn array(
        first: u16,
        (sub, last_sub): (u8, u8),
        data_type: DataType,
        access: Access,
        item: Item,
    ) -> Row {
        Row {
            first,
            sub,
            last_sub,
            data_type,
            access,
            item,
            argument: 0,
        }
    }

    /// A variable has sub-index 0 alone.
    const fn variable(at: u16, data_type: DataType, access: Access, item: Item) -> Row {
        Row::array(at, (0, 0), data_type, access, item)
    }

    const fn of_setting(self, setting: Setting) -> Row {
        Row {
            argument: setting.number(),
            ..self
        }
    }

    const fn variable_setting(at: u16, data_type: DataType, setting: Setting) -> Row {
        Row::variable(at, data_type, Access::ReadWrite, Item::Setting).of_setting(setting)
    }

    /// An array over the nodes, by their places in the network.
    const fn each_node(at: u16, data_type: DataType, access: Access, item: Item) -> Row {
        Row::array(at, (1, EACH_NODE), data_type, access, item)
    }

    /// The same for the objects up to `last`, at most 255 more.
    const fn up_to(self, last: u16) -> Row {
        Row {
            argument: (last - self.first) as u8,
            ..self
        }
    }
}

/// The sub-index that means all nodes.
pub(super) const ALL: u8 = 0x80;
/// The last sub-index of an array over the nodes: how many there are.
pub(super) const EACH_NODE: u8 = u8::MAX;
/// An array whose sub-index is the node-ID.
const NODES: (u8, u8) = (1, NodeId::MAX.get());
/// The most objects that the 64 bits of a PDO hold.
const MAPPED: u8 = 64;
/// Objects of one kind of PDO parameters.
const PDOS: u16 = 0xFF;

pub(super) static TABLE: [Row; 72] = {
    use Access::{Constant, ReadOnly, ReadWrite, WriteOnly};
    use DataType::{
        Domain, Integer8, Integer32, TimeOfDay, Unsigned8, Unsigned16, Unsigned32, Unsigned64,
        VisibleString,
    };
    const fn pdo(first: u16, subs: (u8, u8), data_type: DataType, item: Item) -> Row {
        Row::array(first, subs, data_type, Constant, item).up_to(first + PDOS)
    }
    const fn own_tpdo(
        first: u16,
        subs: (u8, u8),
        data_type: DataType,
        access: Access,
        item: Item,
    ) -> Row {
        Row::array(first, subs, data_type, access, item).up_to(first + OWN_TPDOS - 1)
    }
    const fn transfer_test(subs: (u8, u8), access: Access) -> Row {
        let at = index::TRANSFER_TEST;
        Row::array(at, subs, Unsigned32, access, Item::TransferTest)
    }
    const fn node(at: u16, data_type: DataType, access: Access, item: Item) -> Row {
        Row::array(at, NODES, data_type, access, item)
    }
    [
        Row::variable(index::DEVICE_TYPE, Unsigned32, Constant, Item::DeviceType),
        Row::variable(
            index::ERROR_REGISTER,
            Unsigned8,
            ReadOnly,
            Item::ErrorRegister,
        ),
        Row::variable(index::STATUS_REGISTER, Unsigned32, ReadOnly, Item::Status),
        Row::variable(index::ERROR_FIELD, Unsigned8, ReadWrite, Item::ErrorCount),
        Row::array(
            index::ERROR_FIELD,
            (1, ERROR_FIELD as u8),
            Unsigned32,
            ReadOnly,
            Item::ErrorField,
        ),
        Row::variable_setting(index::COB_ID_SYNC, Unsigned32, Setting::SyncCobId),
        Row::variable_setting(index::SYNC_PERIOD, Unsigned32, Setting::SyncPeriod),
        Row::variable_setting(index::SYNC_WINDOW, Unsigned32, Setting::SyncWindow),
        Row::variable(
            index::DEVICE_NAME,
            VisibleString,
            Constant,
            Item::DeviceName,
        ),
        Row::variable(
            index::HARDWARE_VERSION,
            VisibleString,
            Constant,
            Item::HardwareVersion,
        ),
        Row::variable(
            index::SOFTWARE_VERSION,
            VisibleString,
            Constant,
            Item::SoftwareVersion,
        ),
        // Sub-index 1, all parameters, is all there is.
        Row::array(
            index::STORE_PARAMETERS,
            (1, 1),
            Unsigned32,
            ReadWrite,
            Item::Save,
        ),
        Row::array(
            index::RESTORE_PARAMETERS,
            (1, 1),
            Unsigned32,
            ReadWrite,
            Item::Restore,
        ),
        Row::variable_setting(index::COB_ID_TIME, Unsigned32, Setting::TimeCobId),
        Row::variable_setting(index::COB_ID_EMCY, Unsigned32, Setting::EmcyCobId),
        Row::variable_setting(index::EMCY_INHIBIT, Unsigned16, Setting::EmcyInhibit),
        Row::each_node(
            index::CONSUMER_HEARTBEAT,
            Unsigned32,
            ReadWrite,
            Item::Setting,
        )
        .of_setting(Setting::ConsumerHeartbeat(0)),
        Row::variable_setting(
            index::PRODUCER_HEARTBEAT,
            Unsigned16,
            Setting::ProducerHeartbeat,
        ),
        Row::array(
            index::IDENTITY,
            (1, 4),
            Unsigned32,
            Constant,
            Item::Identity,
        ),
        Row::variable_setting(index::SYNC_OVERFLOW, Unsigned8, Setting::SyncOverflow),
        Row::array(
            index::VERIFY_CONFIGURATION,
            (1, 1),
            Unsigned32,
            ReadWrite,
            Item::Setting,
        )
        .of_setting(Setting::ConfigurationDate),
        Row::array(
            index::VERIFY_CONFIGURATION,
            (2, 2),
            Unsigned32,
            ReadWrite,
            Item::Setting,
        )
        .of_setting(Setting::ConfigurationTime),
        node(
            index::EMCY_CONSUMER,
            Unsigned32,
            Constant,
            Item::EmcyConsumer,
        ),
        Row::array(
            index::ERROR_BEHAVIOUR,
            (1, 1),
            Unsigned8,
            ReadWrite,
            Item::Setting,
        )
        .of_setting(Setting::ErrorBehaviour),
        Row::array(
            index::SDO_SERVER,
            (1, 2),
            Unsigned32,
            Constant,
            Item::SdoServer,
        ),
        Row::array(
            index::SDO_CLIENTS,
            (1, 2),
            Unsigned32,
            Constant,
            Item::SdoClient,
        )
        .up_to(index::SDO_CLIENTS_LAST),
        Row::array(
            index::SDO_CLIENTS,
            (3, 3),
            Unsigned8,
            Constant,
            Item::SdoClientNode,
        )
        .up_to(index::SDO_CLIENTS_LAST),
        pdo(index::RPDO, (1, 1), Unsigned32, Item::PdoCobId),
        pdo(index::RPDO, (2, 2), Unsigned8, Item::PdoTransmission),
        pdo(
            index::RPDO_MAPPING,
            (1, MAPPED),
            Unsigned32,
            Item::PdoMapping,
        ),
        own_tpdo(index::TPDO, (1, 1), Unsigned32, ReadWrite, Item::OwnTpdo),
        own_tpdo(index::TPDO, (2, 2), Unsigned8, ReadWrite, Item::OwnTpdo),
        own_tpdo(
            index::TPDO_MAPPING,
            (1, 2),
            Unsigned32,
            Constant,
            Item::OwnMapping,
        ),
        pdo(index::TPDO, (1, 1), Unsigned32, Item::PdoCobId),
        pdo(index::TPDO, (2, 2), Unsigned8, Item::PdoTransmission),
        pdo(
            index::TPDO_MAPPING,
            (1, MAPPED),
            Unsigned32,
            Item::PdoMapping,
        ),
        node(index::CONCISE_DCF, Domain, Constant, Item::ConciseDcf),
        Row::array(
            index::CONFIGURE,
            (1, ALL),
            Unsigned32,
            WriteOnly,
            Item::Configure,
        ),
        node(
            index::EXPECTED_DATE,
            Unsigned32,
            Constant,
            Item::ConfiguredAt,
        )
        .up_to(index::EXPECTED_TIME),
        Row::variable_setting(index::NMT_STARTUP, Unsigned32, Setting::Startup),
        node(
            index::SLAVE_ASSIGNMENT,
            Unsigned32,
            ReadWrite,
            Item::Setting,
        )
        .of_setting(Setting::Assignment(0)),
        node(index::REQUEST_NMT, Unsigned8, ReadWrite, Item::NmtRequest),
        Row::array(
            index::REQUEST_NMT,
            (ALL, ALL),
            Unsigned8,
            WriteOnly,
            Item::NmtRequest,
        ),
        node(index::EXPECTED_TYPE, Unsigned32, Constant, Item::Expected)
            .up_to(index::EXPECTED_SERIAL),
        Row::variable_setting(index::BOOT_TIME, Unsigned32, Setting::BootTime),
        node(
            index::RESTORE_CONFIGURATION,
            Unsigned8,
            Constant,
            Item::RestoreConfiguration,
        ),
        Row::variable(panel::COMMAND, Unsigned16, ReadWrite, Item::Board),
        Row::variable(panel::STATE, Unsigned8, ReadOnly, Item::Board),
        Row::variable(panel::REFUSAL, Unsigned32, ReadOnly, Item::Board),
        Row::variable(panel::AXES, Unsigned32, ReadWrite, Item::Board),
        Row::each_node(panel::TARGET, Integer32, ReadWrite, Item::Board),
        Row::each_node(panel::VELOCITY, Unsigned32, ReadWrite, Item::Board)
            .up_to(panel::ACCELERATION),
        Row::variable(panel::JERK, Unsigned32, ReadWrite, Item::Board),
        Row::each_node(panel::MODE, Integer8, ReadWrite, Item::Board),
        Row::each_node(panel::POSITION, Integer32, ReadOnly, Item::Board)
            .up_to(panel::FOLLOWING_ERROR),
        Row::each_node(panel::STATUSWORD, Unsigned16, ReadOnly, Item::Board),
        Row::each_node(panel::FAULT, Unsigned32, ReadOnly, Item::Board),
        Row::variable(panel::PROGRAM, Domain, ReadWrite, Item::Board),
        Row::variable(panel::STEP, Unsigned16, ReadOnly, Item::Board),
        node(index::BOOT_LETTER, Unsigned8, ReadOnly, Item::BootLetter),
        node(index::BOOT_WORDS, VisibleString, ReadOnly, Item::BootWords),
        node(index::EMCY_WORDS, VisibleString, ReadOnly, Item::EmcyWords),
        Row::variable(index::CLOCK, TimeOfDay, ReadWrite, Item::Clock),
        Row::variable_setting(index::TIME_PERIOD, Unsigned16, Setting::TimePeriod),
        transfer_test((1, 3), ReadWrite),
        transfer_test((4, 4), WriteOnly),
        transfer_test((5, 7), ReadOnly),
        Row::array(index::MEASURED, (1, 1), Unsigned32, ReadWrite, Item::Board),
        Row::array(index::MEASURED, (2, 13), Unsigned32, ReadOnly, Item::Board),
        Row::variable(index::EMCY_HISTORY, Unsigned8, ReadWrite, Item::EmcyCount)
            .up_to(index::EMCY_HISTORY_LAST),
        Row::array(
            index::EMCY_HISTORY,
            (1, HISTORY as u8),
            Unsigned64,
            ReadOnly,
            Item::EmcyHistory,
        )
        .up_to(index::EMCY_HISTORY_LAST),
        // Of the type that the field has.
        Row::array(
            index::PROCESS,
            (1, u8::MAX),
            Unsigned64,
            ReadOnly,
            Item::Process,
        )
        .up_to(index::PROCESS_LAST),
    ]
};
