//! Board support.
#![no_std]
