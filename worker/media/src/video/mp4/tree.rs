//! MP4's tree of boxes, walked on checked slices.
//!
//! The walk compares every length with the available bytes. `re_mp4` only reads the tables inside single
//! boxes, from a slice that holds nothing but the box. There is no recursion: callers ask for children by
//! name, so nested boxes can't exhaust the stack.

use crate::{MediaError, MediaFault};
use re_mp4::ReadBox;
use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes of all headers (`moov`, `moof`) of a file, at most: 100,000 frames take 3 MiB.
const MAX_HEADERS: u64 = 64 << 20;
/// Top-level boxes of a file, at most.
const MAX_BOXES: usize = 500_000;

/// A box on a slice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Atom<'a> {
    pub(super) name: [u8; 4],
    /// Header and content.
    bytes: &'a [u8],
    header: usize,
}

impl<'a> Atom<'a> {
    /// A box after its header was read.
    pub(super) fn bare(name: [u8; 4], content: &'a [u8]) -> Self {
        Self {
            name,
            bytes: content,
            header: 0,
        }
    }

    /// The content after the header.
    pub(super) fn content(&self) -> &'a [u8] {
        self.bytes.get(self.header..).unwrap_or_default()
    }

    /// The children of a container.
    pub(super) fn children(&self) -> Result<Vec<Atom<'a>>, MediaFault> {
        children(self.content())
    }

    /// The first child of this name.
    pub(super) fn child(&self, name: &[u8; 4]) -> Result<Atom<'a>, MediaFault> {
        self.maybe(name)?.ok_or_else(|| {
            let name = String::from_utf8_lossy(name).into_owned();
            broken(format!("has no '{name}' box"))
        })
    }

    /// The first child of this name, if there is one.
    pub(super) fn maybe(&self, name: &[u8; 4]) -> Result<Option<Atom<'a>>, MediaFault> {
        Ok(self.children()?.into_iter().find(|it| &it.name == name))
    }

    /// The box's table, read by `re_mp4`.
    pub(super) fn read<T>(&self) -> Result<T, MediaFault>
    where
        T: for<'r> ReadBox<&'r mut Cursor<Vec<u8>>>,
    {
        // `re_mp4` expects its reader behind a header of eight bytes, as in a file.
        let mut bytes = vec![0; 8];
        bytes.extend_from_slice(self.content());
        let size = bytes.len() as u64;
        let mut cursor = Cursor::new(bytes);
        cursor.set_position(8);
        T::read_box(&mut cursor, size).map_err(|error| {
            let name = String::from_utf8_lossy(&self.name).into_owned();
            broken(format!("its '{name}' box can't be read: {error}"))
        })
    }
}

/// The boxes in `bytes`, one after the other.
pub(super) fn children(mut bytes: &[u8]) -> Result<Vec<Atom<'_>>, MediaFault> {
    let mut found = Vec::new();
    // Fewer than eight bytes are no box: QuickTime ends some containers with four zero bytes.
    while bytes.len() >= 8 {
        let (size, name, header) = header(bytes);
        let size = match size {
            0 => bytes.len() as u64,
            size => size,
        };
        let length = usize::try_from(size).ok().filter(|&it| it >= header);
        let Some((own, rest)) = length.and_then(|length| bytes.split_at_checked(length)) else {
            let name = String::from_utf8_lossy(&name).into_owned();
            return Err(broken(format!("its '{name}' box says it has {size} bytes")));
        };
        found.push(Atom {
            name,
            bytes: own,
            header,
        });
        bytes = rest;
    }
    Ok(found)
}

/// Size (0: to the end), name and header length of the box at the start of `bytes`, which has at least
/// eight.
fn header(bytes: &[u8]) -> (u64, [u8; 4], usize) {
    let word = |at: usize| {
        let found = bytes.get(at..at + 4).and_then(|it| it.try_into().ok());
        u32::from_be_bytes(found.unwrap_or_default())
    };
    let name = word(4).to_be_bytes();
    // Size 1 announces a size of 64 bits. If that is cut short, the size stays 1, which callers refuse as
    // smaller than the header.
    match word(0) {
        1 if bytes.len() >= 16 => (u64::from(word(8)) << 32 | u64::from(word(12)), name, 16),
        size => (u64::from(size), name, 8),
    }
}

/// The headers of a file.
#[derive(Debug, Default)]
pub(super) struct Headers {
    /// Content of `moov`.
    pub(super) moov: Vec<u8>,
    /// Each `moof`: its byte offset in the file, and its content.
    pub(super) moofs: Vec<(u64, Vec<u8>)>,
    /// Bytes of the file.
    pub(super) size: u64,
    /// Whether the file ends inside a `moof`.
    pub(super) is_cut: bool,
}

/// Finds the headers of the file at `path` without reading its pictures.
pub(super) fn headers(path: &Path) -> Result<Headers, MediaError> {
    let mut file = File::open(path).map_err(MediaError::io(path))?;
    let size = file.metadata().map_err(MediaError::io(path))?.len();
    let mut found = Headers {
        size,
        ..Headers::default()
    };
    let (mut at, mut taken, mut boxes) = (0u64, 0u64, 0usize);
    while at + 8 <= size {
        boxes += 1;
        if boxes > MAX_BOXES {
            return Err(broken(format!("more than {MAX_BOXES} boxes")).into());
        }
        file.seek(SeekFrom::Start(at))
            .map_err(MediaError::io(path))?;
        let mut start = Vec::with_capacity(16);
        (&mut file)
            .take(16)
            .read_to_end(&mut start)
            .map_err(MediaError::io(path))?;
        let (length, name, header) = header(&start);
        let length = if length == 0 { size - at } else { length };
        let end = at.checked_add(length).filter(|_| length >= header as u64);
        let end = end.ok_or_else(|| broken(format!("a box at byte {at} has no valid size")))?;
        if &name == b"moov" || &name == b"moof" {
            let shown = String::from_utf8_lossy(&name).into_owned();
            // Other boxes may end beyond a file that was cut short: `samples` checks each frame.
            if end > size {
                if &name == b"moof" && !found.moov.is_empty() {
                    found.is_cut = true;
                    break;
                }
                let message =
                    format!("is cut short: its '{shown}' box at byte {at} ends at {end} of {size}");
                return Err(broken(message).into());
            }
            taken += length;
            if taken > MAX_HEADERS {
                let message = format!("its headers take more than {MAX_HEADERS} bytes");
                return Err(MediaFault::new("TOO_LARGE", message).into());
            }
            file.seek(SeekFrom::Start(at + header as u64))
                .map_err(MediaError::io(path))?;
            let mut content = Vec::new();
            (&mut file)
                .take(length - header as u64)
                .read_to_end(&mut content)
                .map_err(MediaError::io(path))?;
            if &name == b"moov" {
                found.moov = content;
            } else {
                found.moofs.push((at, content));
            }
        }
        at = end;
    }
    // Too few bytes for the header of another fragment.
    found.is_cut |= at < size && !found.moofs.is_empty();
    if found.moov.is_empty() {
        let message = "has no 'moov' box: it is cut short, or not a video";
        return Err(broken(message).into());
    }
    Ok(found)
}

pub(super) fn broken(message: impl Into<String>) -> MediaFault {
    MediaFault::undecodable(format!("MP4: {}", message.into()))
}
