//! Tests of NMT, EMCY, SYNC, the LSS, the indicators and PDOs.

mod anything;
mod emcy;
mod guarding;
mod led;
mod lss;
mod nmt;
mod pdo;
mod sync;
