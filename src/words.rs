//! The same words for people at the host and for the log of the firmware, where
//! only their numbers are kept in the image.

/// `Display` and `defmt::Format` of a `Copy` type, from one list of patterns.
macro_rules! in_words {
    ($type:ty { $($pattern:pat => ($($words:tt)+),)+ }) => {
        impl core::fmt::Display for $type {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match *self {
                    $($pattern => write!(f, $($words)+),)+
                }
            }
        }

        #[cfg(feature = "defmt")]
        impl defmt::Format for $type {
            fn format(&self, f: defmt::Formatter<'_>) {
                match *self {
                    $($pattern => defmt::write!(f, $($words)+),)+
                }
            }
        }
    };
}

pub(crate) use in_words;
