//! The indices of the master's own object dictionary.

pub(super) const DEVICE_TYPE: u16 = 0x1000;
pub(super) const ERROR_REGISTER: u16 = 0x1001;
pub(super) const STATUS_REGISTER: u16 = 0x1002;
pub(super) const ERROR_FIELD: u16 = 0x1003;
pub(super) const COB_ID_SYNC: u16 = 0x1005;
pub(super) const SYNC_PERIOD: u16 = 0x1006;
pub(super) const SYNC_WINDOW: u16 = 0x1007;
pub(super) const DEVICE_NAME: u16 = 0x1008;
pub(super) const HARDWARE_VERSION: u16 = 0x1009;
pub(super) const SOFTWARE_VERSION: u16 = 0x100A;
pub(super) const STORE_PARAMETERS: u16 = 0x1010;
pub(super) const RESTORE_PARAMETERS: u16 = 0x1011;
pub(super) const COB_ID_TIME: u16 = 0x1012;
pub(super) const COB_ID_EMCY: u16 = 0x1014;
pub(super) const EMCY_INHIBIT: u16 = 0x1015;
pub(super) const CONSUMER_HEARTBEAT: u16 = 0x1016;
pub(super) const PRODUCER_HEARTBEAT: u16 = 0x1017;
pub(super) const IDENTITY: u16 = 0x1018;
pub(super) const SYNC_OVERFLOW: u16 = 0x1019;
pub(super) const VERIFY_CONFIGURATION: u16 = 0x1020;
pub(super) const EMCY_CONSUMER: u16 = 0x1028;
pub(super) const ERROR_BEHAVIOUR: u16 = 0x1029;
pub(super) const SDO_SERVER: u16 = 0x1200;
pub(super) const SDO_CLIENTS: u16 = 0x1280;
pub(super) const SDO_CLIENTS_LAST: u16 = 0x12FF;
pub(super) const RPDO: u16 = 0x1400;
pub(super) const RPDO_MAPPING: u16 = 0x1600;
pub(super) const TPDO: u16 = 0x1800;
pub(super) const TPDO_MAPPING: u16 = 0x1A00;
pub(super) const CONCISE_DCF: u16 = 0x1F22;
pub(super) const CONFIGURE: u16 = 0x1F25;
pub(super) const EXPECTED_DATE: u16 = 0x1F26;
pub(super) const EXPECTED_TIME: u16 = 0x1F27;
pub(super) const NMT_STARTUP: u16 = 0x1F80;
pub(super) const SLAVE_ASSIGNMENT: u16 = 0x1F81;
pub(super) const REQUEST_NMT: u16 = 0x1F82;
pub(super) const EXPECTED_TYPE: u16 = 0x1F84;
pub(super) const EXPECTED_SERIAL: u16 = 0x1F88;
pub(super) const BOOT_TIME: u16 = 0x1F89;
pub(super) const RESTORE_CONFIGURATION: u16 = 0x1F8A;
/// Manufacturer: boot status letter per node.
pub(super) const BOOT_LETTER: u16 = 0x2F00;
/// Manufacturer: boot status per node in words.
pub(super) const BOOT_WORDS: u16 = 0x2F01;
/// Manufacturer: newest emergency per node in words.
pub(super) const EMCY_WORDS: u16 = 0x2F02;
/// Manufacturer: the master's clock.
pub(super) const CLOCK: u16 = 0x2F10;
/// Manufacturer: period of TIME.
pub(super) const TIME_PERIOD: u16 = 0x2F11;
/// Manufacturer: a transfer of test data.
pub(super) const TRANSFER_TEST: u16 = 0x2F12;
/// Manufacturer: what the board measures of itself.
pub(super) const MEASURED: u16 = 0x2F20;
/// Manufacturer: emergencies of node n at 2F80h + n.
pub(super) const EMCY_HISTORY: u16 = 0x2F80;
pub(super) const EMCY_HISTORY_LAST: u16 = 0x2FFF;
/// Manufacturer: process data of node n at 3000h + n.
pub(super) const PROCESS: u16 = 0x3000;
pub(super) const PROCESS_LAST: u16 = 0x307F;
