//! Tests of NMT, EMCY, SYNC, the indicators and PDOs.

mod emcy;
mod nmt;
