//! The settings as a string of bytes: each with index, sub-index and value, so
//! that a later version still understands what it knows.

use super::{Setting, Settings, nodes};
use crate::id::Address;
use crate::network::Network;
use crate::sdo::AbortCode;
use crate::sync::SyncLimits;

/// Index, sub-index, value.
const ENTRY: usize = 7;

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
        let mut free = buf.as_chunks_mut::<ENTRY>().0.iter_mut();
        let mut len = 0;
        for setting in Setting::saved(nodes::<N>(network)) {
            let Some(at) = setting.address(network) else {
                continue;
            };
            let [low, high] = at.index.0.to_le_bytes();
            let [a, b, c, d] = self.get(setting).to_le_bytes();
            let entry = free.next().ok_or(AbortCode::OUT_OF_MEMORY)?;
            *entry = [low, high, at.sub.0, a, b, c, d];
            len += ENTRY;
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
        let (entries, _) = saved.as_chunks::<ENTRY>();
        if entries.is_empty() {
            return settings;
        }
        // The counter's overflow value is accepted only without a period, which
        // comes after it.
        let period = settings.get(Setting::SyncPeriod);
        settings.store(Setting::SyncPeriod, 0);
        let mut has_period = false;
        for [low, high, sub, value @ ..] in entries {
            let at = Address::new(u16::from_le_bytes([*low, *high]), *sub);
            let known = Setting::saved(nodes::<N>(network))
                .find(|setting| setting.address(network) == Some(at));
            if let Some(setting) = known
                && settings
                    .put(setting, u32::from_le_bytes(*value), limits)
                    .is_ok()
            {
                has_period |= setting == Setting::SyncPeriod;
            }
        }
        if !has_period {
            settings.store(Setting::SyncPeriod, period);
            if settings.get(Setting::SyncWindow) > period {
                settings.store(Setting::SyncWindow, 0);
            }
        }
        settings
    }
}
