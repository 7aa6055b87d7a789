//! The firmware's log: defmt frames, as read from the RTT buffer, decoded with
//! the strings of the ELF file.

use std::fmt;

use defmt_decoder::{DecodeError, StreamDecoder, Table};

/// Severity of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Every step.
    Trace,
    /// For the person who changes the firmware.
    Debug,
    /// For the person at the bench.
    Info,
    /// Something is odd and the work goes on.
    Warn,
    /// The work does not go on.
    Error,
}

impl Level {
    /// As defmt spells it.
    pub fn parse(name: &str) -> Option<Level> {
        match name {
            "trace" => Some(Level::Trace),
            "debug" => Some(Level::Debug),
            "info" => Some(Level::Info),
            "warn" => Some(Level::Warn),
            "error" => Some(Level::Error),
            _ => None,
        }
    }

    /// In capitals, as it is printed.
    pub fn as_str(self) -> &'static str {
        match self {
            Level::Trace => "TRACE",
            Level::Debug => "DEBUG",
            Level::Info => "INFO",
            Level::Warn => "WARN",
            Level::Error => "ERROR",
        }
    }
}

/// One line of the firmware's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// The firmware's own time stamp, if the image has one.
    pub timestamp: Option<String>,
    /// `None` for `defmt::println!`.
    pub level: Option<Level>,
    /// The text.
    pub message: String,
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(timestamp) = &self.timestamp {
            write!(f, "{timestamp} ")?;
        }
        if let Some(level) = self.level {
            write!(f, "{:<5} ", level.as_str())?;
        }
        f.write_str(&self.message)
    }
}

/// The image cannot be logged from.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The table of strings is damaged or of another defmt version.
    #[error(
        "the image's defmt table cannot be read: {0}; build image and simulator from the same sources"
    )]
    Table(String),
    /// There is no table of strings.
    #[error("the image has no defmt table: it was linked without defmt.x")]
    NoTable,
}

/// The strings of an image.
pub struct LogTable(Table);

impl LogTable {
    /// Reads them from the ELF file.
    pub fn new(elf: &[u8]) -> Result<LogTable, LogError> {
        match Table::parse(elf) {
            Ok(Some(table)) => Ok(LogTable(table)),
            Ok(None) => Err(LogError::NoTable),
            Err(error) => Err(LogError::Table(format!("{error:#}"))),
        }
    }

    /// A decoder at the beginning of a stream.
    pub fn decoder(&self) -> LogDecoder<'_> {
        LogDecoder {
            table: &self.0,
            stream: self.0.new_stream_decoder(),
            malformed: 0,
        }
    }
}

/// Turns bytes into lines.
pub struct LogDecoder<'t> {
    table: &'t Table,
    stream: Box<dyn StreamDecoder + Send + Sync + 't>,
    malformed: usize,
}

impl LogDecoder<'_> {
    /// Takes bytes in and appends the lines that they complete.
    pub fn decode(&mut self, bytes: &[u8], out: &mut Vec<LogLine>) {
        self.stream.received(bytes);
        loop {
            match self.stream.decode() {
                Ok(frame) => out.push(LogLine {
                    timestamp: frame.display_timestamp().map(|stamp| stamp.to_string()),
                    level: frame.level().and_then(|level| Level::parse(level.as_str())),
                    message: frame.display_message().to_string(),
                }),
                Err(DecodeError::Malformed) if self.table.encoding().can_recover() => {
                    self.malformed += 1;
                }
                Err(_) => return,
            }
        }
    }

    /// The firmware was reset: what is left of a half-sent frame is dropped.
    pub fn restart(&mut self) {
        self.stream = self.table.new_stream_decoder();
    }

    /// Frames that could not be decoded.
    pub fn malformed(&self) -> usize {
        self.malformed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_ordered_by_severity() {
        assert!(Level::Error > Level::Warn && Level::Warn > Level::Info);
        assert!(Level::Debug > Level::Trace);
        for level in [
            Level::Trace,
            Level::Debug,
            Level::Info,
            Level::Warn,
            Level::Error,
        ] {
            assert_eq!(Level::parse(&level.as_str().to_lowercase()), Some(level));
        }
        assert_eq!(Level::parse("loud"), None);
    }

    #[test]
    fn a_line_reads_as_probe_rs_prints_it() {
        let line = LogLine {
            timestamp: Some("0.601234".into()),
            level: Some(Level::Info),
            message: "node 3: boot-up".into(),
        };
        assert_eq!(line.to_string(), "0.601234 INFO  node 3: boot-up");
    }

    #[test]
    fn an_image_without_strings_is_refused() {
        assert!(LogTable::new(b"no image").is_err());
    }
}
