//! The colour coding of a video: range, primaries, transfer function and matrix, in H.273's numbers.

use super::light::{Light, Primaries, Transfer};

/// H.273's number for "not specified".
const UNSPECIFIED: u64 = 2;

/// The coding that a stream, its container, or `ffmpeg` declares.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Signal {
    /// Whether black is 0 and white 255, rather than 16 and 235.
    pub(super) full_range: bool,
    pub(super) primaries: u64,
    pub(super) transfer: u64,
    /// Matrix from RGB.
    pub(super) matrix: u64,
}

impl Signal {
    /// The signal of a stream that declares nothing.
    pub(super) const UNSPECIFIED: Self = Self {
        full_range: false,
        primaries: UNSPECIFIED,
        transfer: UNSPECIFIED,
        matrix: UNSPECIFIED,
    };

    /// The declaration of the stream, with what it leaves open from its container.
    pub(super) fn of(stream: Option<Self>, container: Option<Self>) -> Self {
        let outer = container.unwrap_or(Self::UNSPECIFIED);
        let Some(inner) = stream else {
            return outer;
        };
        let or = |inner: u64, outer: u64| if inner == UNSPECIFIED { outer } else { inner };
        Self {
            full_range: inner.full_range,
            primaries: or(inner.primaries, outer.primaries),
            transfer: or(inner.transfer, outer.transfer),
            matrix: or(inner.matrix, outer.matrix),
        }
    }

    /// The content of MP4's `colr` box: `nclx`, or `nclc` in MOV. `None` for profiles, and if it is cut short.
    pub(super) fn from_box(content: &[u8]) -> Option<Self> {
        let (kind, rest) = content.split_at_checked(4)?;
        let word = |at: usize| {
            let bytes = rest.get(2 * at..2 * at + 2)?.try_into().ok()?;
            Some(u64::from(u16::from_be_bytes(bytes)))
        };
        let full_range = match kind {
            b"nclx" => rest.get(6)? & 0x80 != 0,
            b"nclc" => false,
            _ => return None,
        };
        Some(Self {
            full_range,
            primaries: word(0)?,
            transfer: word(1)?,
            matrix: word(2)?,
        })
    }

    /// From a line of `ffmpeg`'s filter `showinfo`, which names what [`Signal::light`] needs. `None` for other lines.
    pub(super) fn from_showinfo(line: &str) -> Option<Self> {
        let value = |name: &str| line.split_once(name)?.1.split_whitespace().next();
        let transfer = match value("color_trc:")? {
            "arib-std-b67" => 18,
            "smpte2084" => 16,
            "bt709" => 1,
            _ => UNSPECIFIED,
        };
        let primaries = match value("color_primaries:")? {
            "bt2020" => 9,
            "smpte432" => 12,
            "bt709" => 1,
            _ => UNSPECIFIED,
        };
        Some(Self {
            primaries,
            transfer,
            ..Self::UNSPECIFIED
        })
    }

    /// The light that the numbers stand for; `None` for ordinary video, whose numbers are taken as they are.
    pub(super) fn light(&self) -> Option<Light> {
        let transfer = match self.transfer {
            16 => Transfer::Pq,
            18 => Transfer::Hlg,
            _ => Transfer::Sdr,
        };
        let primaries = match self.primaries {
            9 => Primaries::Bt2020,
            12 => Primaries::DisplayP3,
            _ => Primaries::Bt709,
        };
        let is_ordinary = transfer == Transfer::Sdr && primaries == Primaries::Bt709;
        (!is_ordinary).then_some(Light {
            transfer,
            primaries,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_comes_before_its_container() {
        let hlg = Signal {
            full_range: false,
            primaries: 9,
            transfer: 18,
            matrix: 9,
        };
        let open = Signal {
            full_range: true,
            ..Signal::UNSPECIFIED
        };
        assert_eq!(Signal::of(None, None), Signal::UNSPECIFIED);
        assert_eq!(Signal::of(None, Some(hlg)), hlg);
        let both = Signal::of(Some(open), Some(hlg));
        assert!(both.full_range && both.transfer == 18);
        let sdr = Signal {
            transfer: 1,
            ..open
        };
        assert_eq!(Signal::of(Some(sdr), Some(hlg)).transfer, 1);
    }

    #[test]
    fn boxes_and_lines_of_ffmpeg_are_read() {
        let found = Signal::from_box(b"nclx\0\x09\0\x12\0\x09\x80").expect("a box");
        assert_eq!((found.primaries, found.transfer, found.matrix), (9, 18, 9));
        assert!(found.full_range);
        let found = Signal::from_box(b"nclc\0\x01\0\x01\0\x01").expect("a box");
        assert_eq!(found.light(), None);
        for bad in [&b"prof...."[..], b"nclx\0\x09\0", b"ncl", b""] {
            assert_eq!(Signal::from_box(bad), None, "{bad:?}");
        }
        let line = "[Parsed_showinfo_0 @ 0x1] color_range:tv color_space:bt2020nc \
                    color_primaries:bt2020 color_trc:smpte2084";
        let light = Signal::from_showinfo(line).and_then(|it| it.light());
        let pq = Light {
            transfer: Transfer::Pq,
            primaries: Primaries::Bt2020,
        };
        assert_eq!(light, Some(pq));
        assert_eq!(Signal::from_showinfo("n:   0 pts:      0"), None);
    }
}
