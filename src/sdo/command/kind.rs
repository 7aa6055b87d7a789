//! Which command it is: command specifier and sub-command.

/// Bits of the command specifier (`ccs`, `scs`).
const SPECIFIER: u8 = 0xE0;
/// Those and the sub-command, in the two specifiers of the block protocols. That
/// of the side that sends the data has one bit only.
const RECEIVER: u8 = SPECIFIER | 0x03;
const SENDER: u8 = SPECIFIER | 0x01;

/// The bits of the first byte that tell commands apart: the same in both
/// directions.
const fn code(head: u8) -> u8 {
    head & match head & SPECIFIER {
        0xA0 => RECEIVER,
        0xC0 => SENDER,
        _ => SPECIFIER,
    }
}

macro_rules! commands {
    ($(#[$of:meta])* $name:ident { $($(#[$doc:meta])* $kind:ident = $code:literal,)* }) => {
        $(#[$of])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $($(#[$doc])* $kind = $code,)*
        }

        impl $name {
            /// The first byte without its flags.
            pub const fn code(self) -> u8 {
                self as u8
            }

            pub(super) const fn of(head: u8) -> Option<$name> {
                Some(match code(head) {
                    $($code => $name::$kind,)*
                    _ => return None,
                })
            }
        }
    };
}

commands! {
    /// What a client sends to a server.
    Request {
        /// CiA 301, 7.2.4.3.4.
        DownloadSegment = 0x00,
        /// Start of a download (CiA 301, 7.2.4.3.3).
        Download = 0x20,
        /// Start of an upload (CiA 301, 7.2.4.3.6).
        Upload = 0x40,
        /// CiA 301, 7.2.4.3.7.
        UploadSegment = 0x60,
        /// CiA 301, 7.2.4.3.17.
        Abort = 0x80,
        /// Start of a block upload (CiA 301, 7.2.4.3.13).
        BlockUpload = 0xA0,
        /// CiA 301, 7.2.4.3.15.
        BlockUploadEnd = 0xA1,
        /// CiA 301, 7.2.4.3.14.
        BlockUploadAcknowledge = 0xA2,
        /// CiA 301, 7.2.4.3.13.
        BlockUploadStart = 0xA3,
        /// Start of a block download (CiA 301, 7.2.4.3.9).
        BlockDownload = 0xC0,
        /// CiA 301, 7.2.4.3.11.
        BlockDownloadEnd = 0xC1,
    }
}

commands! {
    /// What a server answers.
    Answer {
        /// CiA 301, 7.2.4.3.7.
        UploadSegment = 0x00,
        /// CiA 301, 7.2.4.3.4.
        DownloadSegment = 0x20,
        /// CiA 301, 7.2.4.3.6.
        Upload = 0x40,
        /// CiA 301, 7.2.4.3.3.
        Download = 0x60,
        /// CiA 301, 7.2.4.3.17.
        Abort = 0x80,
        /// CiA 301, 7.2.4.3.9.
        BlockDownload = 0xA0,
        /// CiA 301, 7.2.4.3.11.
        BlockDownloadEnd = 0xA1,
        /// CiA 301, 7.2.4.3.10.
        BlockDownloadAcknowledge = 0xA2,
        /// CiA 301, 7.2.4.3.13.
        BlockUpload = 0xC0,
        /// CiA 301, 7.2.4.3.15.
        BlockUploadEnd = 0xC1,
    }
}

impl Request {
    /// Whether the command names an entry: an initiate or an abort does.
    pub const fn is_addressed(self) -> bool {
        matches!(
            self,
            Request::Download
                | Request::Upload
                | Request::BlockDownload
                | Request::BlockUpload
                | Request::Abort
        )
    }
}

impl Answer {
    /// Whether the command names an entry: an initiate or an abort does.
    pub const fn is_addressed(self) -> bool {
        matches!(
            self,
            Answer::Download
                | Answer::Upload
                | Answer::BlockDownload
                | Answer::BlockUpload
                | Answer::Abort
        )
    }
}
