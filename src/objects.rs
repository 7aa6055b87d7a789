//! The entries of object dictionaries that the master reads and writes, by the
//! names that the standards give them.

use crate::id::Address;

/// Device type (CiA 301, 7.5.2.1), U32.
pub const DEVICE_TYPE: Address = Address::new(0x1000, 0);
/// Error register (CiA 301, 7.5.2.2), U8.
pub const ERROR_REGISTER: Address = Address::new(0x1001, 0);
/// COB-ID SYNC (CiA 301, 7.5.2.5), U32; bit 30: the device produces SYNC.
pub const COB_ID_SYNC: Address = Address::new(0x1005, 0);
/// Communication cycle period (CiA 301, 7.5.2.6), U32 in microseconds.
pub const COMMUNICATION_CYCLE: Address = Address::new(0x1006, 0);
/// Restore default parameters (CiA 301, 7.5.2.14): an index, the sub-index tells
/// which.
pub const RESTORE_PARAMETERS: u16 = 0x1011;
/// Consumer heartbeat time, first entry (CiA 301, 7.5.2.19), U32: node in bits
/// 23..16, milliseconds in bits 15..0.
pub const CONSUMER_HEARTBEAT: Address = Address::new(0x1016, 1);
/// Producer heartbeat time (CiA 301, 7.5.2.20), U16 in milliseconds.
pub const PRODUCER_HEARTBEAT: Address = Address::new(0x1017, 0);
/// Identity object: vendor-ID (CiA 301, 7.5.2.21), U32.
pub const VENDOR_ID: Address = Address::new(0x1018, 1);
/// Identity object: product code, U32.
pub const PRODUCT_CODE: Address = Address::new(0x1018, 2);
/// Identity object: revision number, U32.
pub const REVISION_NUMBER: Address = Address::new(0x1018, 3);
/// Identity object: serial number, U32.
pub const SERIAL_NUMBER: Address = Address::new(0x1018, 4);
/// Verify configuration: date (CiA 301, 7.5.2.23), U32 in days since 1984-01-01.
pub const CONFIGURATION_DATE: Address = Address::new(0x1020, 1);
/// Verify configuration: time, U32 in milliseconds since midnight.
pub const CONFIGURATION_TIME: Address = Address::new(0x1020, 2);

/// Sub-index of a PDO communication parameter: COB-ID.
pub const PDO_COB_ID: u8 = 1;
/// Sub-index of a PDO communication parameter: transmission type.
pub const PDO_TRANSMISSION_TYPE: u8 = 2;
/// Sub-index of a TPDO communication parameter: inhibit time, 100 us.
pub const PDO_INHIBIT_TIME: u8 = 3;

/// Abort connection option code (CiA 402), I16: what the drive does when its
/// heartbeat consumer misses the master.
pub const ABORT_CONNECTION_OPTION: Address = Address::new(0x6007, 0);
/// Controlword (CiA 402), U16.
pub const CONTROLWORD: Address = Address::new(0x6040, 0);
/// Statusword (CiA 402), U16.
pub const STATUSWORD: Address = Address::new(0x6041, 0);
/// Modes of operation (CiA 402), I8.
pub const MODES_OF_OPERATION: Address = Address::new(0x6060, 0);
/// Modes of operation display (CiA 402), I8.
pub const MODES_OF_OPERATION_DISPLAY: Address = Address::new(0x6061, 0);
/// Position actual value (CiA 402), I32 in increments.
pub const POSITION_ACTUAL: Address = Address::new(0x6064, 0);
/// Velocity actual value (CiA 402), I32 in velocity units.
pub const VELOCITY_ACTUAL: Address = Address::new(0x606C, 0);
/// Profile velocity (CiA 402), U32 in velocity units: of a set-point in profile position mode.
pub const PROFILE_VELOCITY: Address = Address::new(0x6081, 0);
/// Target torque (CiA 402), I16 in per mille of the rated torque.
pub const TARGET_TORQUE: Address = Address::new(0x6071, 0);
/// Torque actual value (CiA 402), I16 in per mille of the rated torque.
pub const TORQUE_ACTUAL: Address = Address::new(0x6077, 0);
/// Target position (CiA 402), I32 in increments.
pub const TARGET_POSITION: Address = Address::new(0x607A, 0);
/// Max profile velocity (CiA 402), U32.
pub const MAX_PROFILE_VELOCITY: Address = Address::new(0x607F, 0);
/// Max motor speed (CiA 402), U32.
pub const MAX_MOTOR_SPEED: Address = Address::new(0x6080, 0);
/// Profile acceleration (CiA 402), U32.
pub const PROFILE_ACCELERATION: Address = Address::new(0x6083, 0);
/// Profile deceleration (CiA 402), U32.
pub const PROFILE_DECELERATION: Address = Address::new(0x6084, 0);
/// Quick stop deceleration (CiA 402), U32.
pub const QUICK_STOP_DECELERATION: Address = Address::new(0x6085, 0);
/// Interpolation time period value (CiA 402), U8 in units of 60C2h:2.
pub const INTERPOLATION_TIME: Address = Address::new(0x60C2, 1);
/// Max acceleration (CiA 402), U32.
pub const MAX_ACCELERATION: Address = Address::new(0x60C5, 0);
/// Target velocity (CiA 402), I32.
pub const TARGET_VELOCITY: Address = Address::new(0x60FF, 0);
