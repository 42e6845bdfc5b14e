//! Boxes of MP4 and MOV (ISO/IEC 14496-12).

use super::{Container, length, read, write, zero};
use std::io;

/// Boxes that describe a film: user data, metadata, extensions such as XMP.
const TAGS: [[u8; 4]; 3] = [*b"udta", *b"meta", *b"uuid"];
/// Handlers of the tracks that stay: pictures, sound, time codes.
const KEPT: [[u8; 4]; 3] = [*b"vide", *b"soun", *b"tmcd"];
/// Most entries of a table that are read.
const ENTRIES: u64 = 10_000_000;

/// A box in the file, from `start` to `end`, with its content from `body` on.
#[derive(Debug, Clone, Copy)]
struct Region {
    kind: [u8; 4],
    start: u64,
    body: u64,
    end: u64,
}

pub(super) fn remove(file: &mut impl Container) -> io::Result<()> {
    let end = length(file)?;
    for top in children(file, 0, end)? {
        match &top.kind {
            b"moov" => movie(file, top)?,
            kind if TAGS.contains(kind) => blank(file, top)?,
            _ => {}
        }
    }
    Ok(())
}

fn movie(file: &mut impl Container, movie: Region) -> io::Result<()> {
    for part in children(file, movie.body, movie.end)? {
        match &part.kind {
            b"trak" => track(file, part)?,
            kind if TAGS.contains(kind) => blank(file, part)?,
            _ => {}
        }
    }
    Ok(())
}

fn track(file: &mut impl Container, track: Region) -> io::Result<()> {
    let media = child(file, Some(track), *b"mdia")?;
    let handler = match child(file, media, *b"hdlr")? {
        Some(handler) => read::<4>(file, handler.body + 8)?,
        None => None,
    };
    if handler.is_some_and(|it| !KEPT.contains(&it)) {
        // Positions along the way are samples of such a track.
        let information = child(file, media, *b"minf")?;
        if let Some(table) = child(file, information, *b"stbl")? {
            samples(file, table)?;
        }
        return blank(file, track);
    }
    for part in children(file, track.body, track.end)? {
        if TAGS.contains(&part.kind) {
            blank(file, part)?;
        }
    }
    Ok(())
}

/// Overwrites the samples of a track.
fn samples(file: &mut impl Container, table: Region) -> io::Result<()> {
    let end = length(file)?;
    let parts = children(file, table.body, table.end)?;
    let of = |kind: &[u8; 4]| parts.iter().find(|it| it.kind == *kind).copied();
    let (Some(sizes), Some(chunks)) = (of(b"stsz"), of(b"stsc")) else {
        return Ok(());
    };
    let offsets = match (of(b"stco"), of(b"co64")) {
        (Some(narrow), _) => numbers(file, narrow, 8, 4)?,
        (None, Some(wide)) => numbers(file, wide, 8, 8)?,
        (None, None) => return Ok(()),
    };
    let same = read::<4>(file, sizes.body + 4)?.map_or(0, u32::from_be_bytes);
    let sizes = match same {
        0 => numbers(file, sizes, 12, 4)?,
        _ => Vec::new(),
    };
    // First chunk, samples per chunk, description.
    let runs = numbers(file, chunks, 8, 4)?;
    let mut sizes = sizes.into_iter();
    for (chunk, offset) in (1..).zip(offsets) {
        let run = runs.chunks_exact(3).take_while(|it| it[0] <= chunk).last();
        let count = run.map_or(0, |it| it[1].min(ENTRIES));
        let bytes: u64 = match same {
            0 => sizes.by_ref().take(count as usize).sum(),
            same => count * u64::from(same),
        };
        zero(file, offset.min(end), offset.saturating_add(bytes).min(end))?;
    }
    Ok(())
}

/// The numbers of a table whose entries of `width` bytes begin `skip` bytes after its start.
fn numbers(
    file: &mut impl Container,
    table: Region,
    skip: u64,
    width: u64,
) -> io::Result<Vec<u64>> {
    let mut found = Vec::new();
    let mut at = table.body + skip;
    while at + width <= table.end && (found.len() as u64) < ENTRIES {
        let number = match width {
            8 => read::<8>(file, at)?.map(u64::from_be_bytes),
            _ => read::<4>(file, at)?.map(|it| u32::from_be_bytes(it).into()),
        };
        let Some(number) = number else { break };
        found.push(number);
        at += width;
    }
    Ok(found)
}

/// Makes a box one of free space.
fn blank(file: &mut impl Container, region: Region) -> io::Result<()> {
    write(file, region.start + 4, b"free")?;
    zero(file, region.body, region.end)
}

fn child(
    file: &mut impl Container,
    parent: Option<Region>,
    kind: [u8; 4],
) -> io::Result<Option<Region>> {
    let Some(parent) = parent else {
        return Ok(None);
    };
    let inner = children(file, parent.body, parent.end)?;
    Ok(inner.into_iter().find(|it| it.kind == kind))
}

/// The boxes between two places, up to the first that is none.
fn children(file: &mut impl Container, from: u64, to: u64) -> io::Result<Vec<Region>> {
    let mut found = Vec::new();
    let mut at = from;
    while at + 8 <= to {
        let Some([a, b, c, d, kind @ ..]) = read::<8>(file, at)? else {
            break;
        };
        let (body, bytes) = match u32::from_be_bytes([a, b, c, d]) {
            0 => (at + 8, to - at),
            1 => match read::<8>(file, at + 8)? {
                Some(wide) => (at + 16, u64::from_be_bytes(wide)),
                None => break,
            },
            narrow => (at + 8, narrow.into()),
        };
        let end = at.saturating_add(bytes);
        if end < body || end > to {
            break;
        }
        found.push(Region {
            kind,
            start: at,
            body,
            end,
        });
        at = end;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use crate::Limits;
    use crate::video::tags::tests::{has, removed};
    use crate::video::{Ffmpeg, Video, remove_tags};
    use std::path::Path;

    fn boxed(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        let length = u32::try_from(content.len() + 8).expect("is short");
        [&length.to_be_bytes(), &kind[..], content].concat()
    }

    fn numbers(all: &[u32]) -> Vec<u8> {
        all.iter().flat_map(|it| it.to_be_bytes()).collect()
    }

    /// A track with this handler and two samples of four bytes at `offset`.
    fn track(handler: &[u8; 4], offset: u32) -> Vec<u8> {
        let hdlr = boxed(b"hdlr", &[&[0; 8][..], handler, &[0; 12]].concat());
        let stbl = [
            boxed(b"stsz", &numbers(&[0, 0, 2, 4, 4])),
            boxed(b"stsc", &numbers(&[0, 1, 1, 2, 1])),
            boxed(b"stco", &numbers(&[0, 1, offset])),
        ];
        let minf = boxed(b"minf", &boxed(b"stbl", &stbl.concat()));
        let udta = boxed(b"udta", b"Ada's track");
        boxed(
            b"trak",
            &[udta, boxed(b"mdia", &[hdlr, minf].concat())].concat(),
        )
    }

    #[test]
    fn tags_and_positions_go_and_the_film_stays() {
        let film = [
            boxed(b"ftyp", b"isom"),
            boxed(b"mdat", b"PICTURE!+48.1374"),
            boxed(
                b"moov",
                &[
                    track(b"vide", 20),
                    track(b"meta", 28),
                    boxed(b"udta", b"\xa9xyz+48.1374+011.5755/"),
                    boxed(b"meta", b"com.apple.quicktime.location.ISO6709"),
                ]
                .concat(),
            ),
            boxed(b"uuid", b"XMP of Ada"),
        ]
        .concat();
        let after = removed(&film);
        for tag in [&b"+48.1374"[..], b"apple", b"Ada", b"udta", b"XMP"] {
            assert!(has(&film, tag) && !has(&after, tag), "{tag:?}");
        }
        for kept in [&b"PICTURE!"[..], b"vide", b"ftyp", b"moov"] {
            assert!(has(&after, kept), "{kept:?}");
        }
        assert_eq!(removed(&after), after);
    }

    #[test]
    fn what_is_broken_is_left_alone() {
        let film = boxed(b"moov", &boxed(b"udta", b"+48.1374"));
        for length in 0..film.len() {
            removed(&film[..length]);
        }
        let longer = [&[255; 4][..], b"moov", b"udta"].concat();
        assert_eq!(removed(&longer), longer);
    }

    #[test]
    fn a_film_is_decoded_as_before() {
        let clips = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clips");
        let folder = tempfile::tempdir().expect("a folder");
        for name in [
            "b_frames.mp4",
            "b_frames.mov",
            "fragmented.mp4",
            "turned_right.mp4",
        ] {
            let copy = folder.path().join(name);
            std::fs::copy(clips.join(name), &copy).expect("copies");
            remove_tags(&copy).expect("removes");
            let frames = |path: &Path| {
                let video = Video::open(path, &Limits::default(), &Ffmpeg::none(), false);
                let mut video = video.expect("opens");
                let mut frames = Vec::new();
                while let Some(picture) = video.next(false).expect("decodes") {
                    frames.push(picture.rgb);
                }
                frames
            };
            assert!(frames(&copy) == frames(&clips.join(name)), "{name}");
        }
    }
}
