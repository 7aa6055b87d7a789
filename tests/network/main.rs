//! Tests of NMT, EMCY, SYNC, the indicators and PDOs.

mod emcy;
mod led;
mod nmt;
mod pdo;
mod sync;
