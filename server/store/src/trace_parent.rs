//! The caller's place in a trace: the header `traceparent` of W3C's Trace Context, level 1.

use std::fmt;
use yoto_proto::hex;

/// A span of the caller, which becomes the parent of a job's span.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TraceParent {
    /// The trace; not 0.
    pub trace: [u8; 16],
    /// The span; not 0.
    pub span: [u8; 8],
    /// Bit 0: the caller records its own spans.
    flags: u8,
}

impl TraceParent {
    /// Reads `version-trace-span-flags`, all in lower-case hex digits. Versions after 00 may have more fields behind.
    pub fn parse(text: &str) -> Option<Self> {
        let mut fields = text.split('-');
        let [version] = hex::decode_array(fields.next()?)?;
        let trace: [u8; 16] = hex::decode_array(fields.next()?)?;
        let span: [u8; 8] = hex::decode_array(fields.next()?)?;
        let [flags] = hex::decode_array(fields.next()?)?;
        let whole = version != 0 || fields.next().is_none();
        let valid = version != 0xff && whole && trace != [0; 16] && span != [0; 8];
        valid.then_some(Self { trace, span, flags })
    }
}

/// The form of version 00, which [`TraceParent::parse`] reads.
impl fmt::Display for TraceParent {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { trace, span, flags } = self;
        write!(out, "00-{}-{}-{flags:02x}", hex(trace), hex(span))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: &str = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";

    #[test]
    fn a_header_is_read_and_written() {
        let read = TraceParent::parse(EXAMPLE).expect("the standard's example");
        assert_eq!(read.trace[..2], [0x4b, 0xf9]);
        assert_eq!(read.span[6..], [0x02, 0xb7]);
        assert_eq!(read.to_string(), EXAMPLE);
    }

    #[test]
    fn a_later_version_may_say_more() {
        let later = format!("01{}-more", &EXAMPLE[2..]);
        assert_eq!(TraceParent::parse(&later), TraceParent::parse(EXAMPLE));
    }

    #[test]
    fn what_is_malformed_counts_as_absent() {
        for text in [
            "",
            "00",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-more",
            "ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
            "00-4BF92F3577B34DA6A3CE929D0E0E4736-00F067AA0BA902B7-01",
            "00-00000000000000000000000000000000-00f067aa0ba902b7-01",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01",
            "00-4bf92f3577b34da6a3ce929d0e0e473-00f067aa0ba902b7-01",
            "00-+bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
            "00-\u{e9}f92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
        ] {
            assert_eq!(TraceParent::parse(text), None, "{text}");
        }
    }
}
