//! Detects a file's format by its first bytes, since names can be wrong.

/// Detected kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileType {
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
    /// WebP.
    WebP,
    /// MP4, MOV and related formats.
    Mp4,
    /// Matroska or WebM.
    Matroska,
    /// AVI.
    Avi,
    /// MPEG transport or programme stream.
    Mpeg,
    /// Zip.
    Zip,
    /// Tar.
    Tar,
    /// A gzipped file, read as a tar.
    Gzip,
    /// HDF5 and NumPy's formats, which are imported, not uploaded.
    Array,
    /// Unknown format.
    Unknown,
}

/// Bytes that [`kind`] needs.
pub const PREFIX: usize = 512;

/// The kind of a file that starts with `bytes`.
pub fn kind(bytes: &[u8]) -> FileType {
    let at = |from: usize, magic: &[u8]| {
        bytes
            .get(from..from + magic.len())
            .is_some_and(|found| found == magic)
    };
    if at(0, b"\x89PNG\r\n\x1a\n") {
        FileType::Png
    } else if at(0, b"\xff\xd8\xff") {
        FileType::Jpeg
    } else if at(0, b"RIFF") && at(8, b"WEBP") {
        FileType::WebP
    } else if at(0, b"RIFF") && at(8, b"AVI ") {
        FileType::Avi
    } else if at(0, b"\x1a\x45\xdf\xa3") {
        FileType::Matroska
    } else if at(0, b"\0\0\x01\xba") || (at(0, b"\x47") && at(188, b"\x47")) {
        FileType::Mpeg
    } else if [&b"ftyp"[..], b"moov", b"mdat", b"wide", b"free", b"skip"]
        .iter()
        .any(|name| at(4, name))
    {
        FileType::Mp4
    } else if at(0, b"PK\x03\x04") || at(0, b"PK\x05\x06") {
        FileType::Zip
    } else if at(257, b"ustar") {
        FileType::Tar
    } else if at(0, b"\x1f\x8b") {
        FileType::Gzip
    } else if at(0, b"\x89HDF") || at(0, b"\x93NUMPY") {
        FileType::Array
    } else {
        FileType::Unknown
    }
}

impl FileType {
    /// Readable name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "a PNG picture",
            Self::Jpeg => "a JPEG picture",
            Self::WebP => "a WebP picture",
            Self::Mp4 => "an MP4 or MOV video",
            Self::Matroska => "a Matroska or WebM video",
            Self::Avi => "an AVI video",
            Self::Mpeg => "an MPEG video",
            Self::Zip => "a zip archive",
            Self::Tar => "a tar archive",
            Self::Gzip => "a gzipped file",
            Self::Array => "an HDF5 or NumPy file",
            Self::Unknown => "of no known format",
        }
    }

    /// Whether it holds one picture.
    pub fn is_still(self) -> bool {
        matches!(self, Self::Png | Self::Jpeg | Self::WebP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_content_and_short_files_are_unknown() {
        assert_eq!(kind(b"\x89PNG\r\n\x1a\n...."), FileType::Png);
        assert_eq!(kind(b"\0\0\0\x20ftypisom"), FileType::Mp4);
        assert_eq!(kind(b"RIFF\0\0\0\0AVI LIST"), FileType::Avi);
        assert_eq!(kind(b"RIFF\0\0\0\0WEBPVP8 "), FileType::WebP);
        assert_eq!(kind(b"PK\x03\x04"), FileType::Zip);
        for short in [&b""[..], b"\x89PN", b"RIFF", b"no picture at all"] {
            assert_eq!(kind(short), FileType::Unknown);
        }
    }
}
