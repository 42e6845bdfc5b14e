//! Videos of synthetic people: H.264 in MP4, encoded and muxed here, so that tests need no
//! other program.

use anyhow::Context;
use openh264::encoder::Encoder;
use openh264::formats::{RgbSliceU8, YUVBuffer};
use std::path::Path;
use yoto_capture::FrameImage;

/// Writes `frames`, of even sides, at `fps` frames per second to `path`.
///
/// # Errors
/// When the encoder or the disk fails.
pub fn write_mp4(frames: &[FrameImage], fps: u32, path: &Path) -> anyhow::Result<()> {
    let first = frames.first().context("a film has frames")?;
    let mut encoder = Encoder::new()?;
    let (mut sps, mut pps, mut samples) = (Vec::new(), Vec::new(), Vec::new());
    for frame in frames {
        let rgb = RgbSliceU8::new(&frame.rgb, (frame.width, frame.height));
        let stream = encoder.encode(&YUVBuffer::from_rgb_source(rgb))?.to_vec();
        let mut sample = Vec::new();
        for unit in units(&stream) {
            match unit.first().map(|byte| byte & 0x1f) {
                Some(7) => sps = unit.to_vec(),
                Some(8) => pps = unit.to_vec(),
                _ => {
                    sample.extend((unit.len() as u32).to_be_bytes());
                    sample.extend(unit);
                }
            }
        }
        samples.push(sample);
    }
    let bytes = mp4((first.width, first.height), fps, &sps, &pps, &samples);
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}

/// Units between start codes.
fn units(stream: &[u8]) -> Vec<&[u8]> {
    let starts: Vec<usize> = (0..stream.len().saturating_sub(2))
        .filter(|&at| stream[at..at + 3] == [0, 0, 1])
        .collect();
    let ends = starts.iter().skip(1).copied().chain([stream.len()]);
    let pairs = starts.iter().zip(ends);
    pairs
        .map(|(&start, end)| {
            let unit = &stream[start + 3..end];
            let zeros = unit.iter().rev().take_while(|&&byte| byte == 0).count();
            &unit[..unit.len() - zeros]
        })
        .collect()
}

/// A box of parts one after the other.
fn boxed(name: &[u8; 4], parts: &[&[u8]]) -> Vec<u8> {
    let length: usize = parts.iter().map(|part| part.len()).sum();
    let mut out = (8 + length as u32).to_be_bytes().to_vec();
    out.extend(name);
    parts.iter().for_each(|part| out.extend(*part));
    out
}

fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}

/// An MP4 of `samples` of `sps` and `pps`, whatever they hold.
pub fn mp4(size: (usize, usize), fps: u32, sps: &[u8], pps: &[u8], samples: &[Vec<u8>]) -> Vec<u8> {
    let (width, height) = (size.0 as u32, size.1 as u32);
    let count = samples.len() as u32;
    let ftyp = boxed(b"ftyp", &[b"isom", &words(&[0]), b"isomavc1"]);
    let data: Vec<u8> = samples.concat();
    let mdat = boxed(b"mdat", &[&data]);
    let matrix = words(&[1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30]);
    let tkhd = boxed(
        b"tkhd",
        &[
            &words(&[3, 0, 0, 1, 0, count, 0, 0, 0, 0]),
            &matrix,
            &words(&[width << 16, height << 16]),
        ],
    );
    let mdhd = boxed(b"mdhd", &[&words(&[0, 0, 0, fps, count, 0])]);
    let hdlr = boxed(
        b"hdlr",
        &[&words(&[0, 0]), b"vide", &words(&[0, 0, 0]), b"\0"],
    );
    let length = |set: &[u8]| (set.len() as u16).to_be_bytes();
    let avcc = boxed(
        b"avcC",
        &[
            &[1, sps[1], sps[2], sps[3], 0xff, 0xe1],
            &length(sps),
            sps,
            &[1],
            &length(pps),
            pps,
        ],
    );
    let mut entry = vec![0; 78];
    entry[7] = 1;
    entry[24..26].copy_from_slice(&(width as u16).to_be_bytes());
    entry[26..28].copy_from_slice(&(height as u16).to_be_bytes());
    let avc1 = boxed(b"avc1", &[&entry, &avcc]);
    let sizes: Vec<u32> = samples.iter().map(|sample| sample.len() as u32).collect();
    let stbl = boxed(
        b"stbl",
        &[
            &boxed(b"stsd", &[&words(&[0, 1]), &avc1]),
            &boxed(b"stts", &[&words(&[0, 1, count, 1])]),
            &boxed(b"stsc", &[&words(&[0, 1, 1, count, 1])]),
            &boxed(b"stsz", &[&words(&[0, 0, count]), &words(&sizes)]),
            &boxed(b"stco", &[&words(&[0, 1, ftyp.len() as u32 + 8])]),
        ],
    );
    let mdia = boxed(b"mdia", &[&mdhd, &hdlr, &boxed(b"minf", &[&stbl])]);
    let moov = boxed(b"moov", &[&boxed(b"trak", &[&tkhd, &mdia])]);
    [ftyp, mdat, moov].concat()
}
