//! The settings as a string of bytes: each with index, sub-index and length, so
//! that a later version still understands what it knows.

use super::{Setting, Settings, nodes};
use crate::id::Address;
use crate::network::Network;
use crate::od::Value;
use crate::sdo::AbortCode;
use crate::sync::{SyncLimits, SyncParameters};

impl<const N: usize> Settings<N> {
    /// Writes every setting that is saved into `buf`; returns the bytes used.
    ///
    /// # Errors
    /// 05040005h if `buf` is too short.
    pub(in crate::device) fn encode(
        &self,
        network: &Network,
        buf: &mut [u8],
    ) -> Result<usize, AbortCode> {
        let mut len = 0;
        for setting in Setting::saved(nodes::<N>(network)) {
            let Some(at) = setting.address(network) else {
                continue;
            };
            let value = Value::new(setting.data_type(), i64::from(self.get(setting)));
            let [low, high] = at.index.0.to_le_bytes();
            let size = value.bytes().len();
            let head = [low, high, at.sub.0, size as u8];
            for byte in head.iter().chain(value.bytes()) {
                *buf.get_mut(len).ok_or(AbortCode::OUT_OF_MEMORY)? = *byte;
                len += 1;
            }
        }
        Ok(len)
    }

    /// The design's settings with those from `saved` over them. What is not
    /// known or not accepted any more is left out.
    pub(in crate::device) fn decode(
        network: &Network,
        saved: &[u8],
        limits: &SyncLimits,
    ) -> Settings<N> {
        let mut settings = Settings::new(network);
        if saved.is_empty() {
            return settings;
        }
        // The counter's overflow value is accepted only without a period, which
        // comes after it.
        let period = settings.sync.period();
        settings.sync = SyncParameters::new(0);
        let mut has_period = false;
        let mut rest = saved;
        while let &[low, high, sub, size, ref tail @ ..] = rest {
            let Some((data, next)) = tail.split_at_checked(usize::from(size)) else {
                break;
            };
            rest = next;
            let at = Address::new(u16::from_le_bytes([low, high]), sub);
            let known = Setting::saved(nodes::<N>(network))
                .find(|setting| setting.address(network) == Some(at));
            let Some(setting) = known else { continue };
            let Ok(value) = Value::from_bytes(setting.data_type(), data) else {
                continue;
            };
            let taken = settings.put(setting, value.as_u32(), limits).is_ok();
            has_period |= taken && setting == Setting::SyncPeriod;
        }
        if !has_period && settings.sync.set_period(period, &SyncLimits::NONE).is_err() {
            // Only a window that is too long can have refused it.
            settings.sync = SyncParameters::new(period);
        }
        settings
    }
}
