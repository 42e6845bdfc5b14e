//! Videos and pictures: truncated, empty, mislabelled, declared too large, missing.

use super::{Case, all_are_rejected, film, pictures, png_bomb, with, without};
use anyhow::Context;
use yoto_client::UploadFile;
use yoto_tests::film::mp4;

/// The first offset of `name` in a file's boxes.
fn box_at(bytes: &[u8], name: &[u8; 4]) -> anyhow::Result<usize> {
    let at = bytes.windows(4).position(|it| it == name);
    at.with_context(|| String::from_utf8_lossy(name).into_owned())
}

/// The film with its header changed to declare `count` frames of one byte.
fn declaring(film: &[u8], count: u32) -> anyhow::Result<Vec<u8>> {
    let mut film = film.to_vec();
    let sizes = box_at(&film, b"stsz")? + 8;
    film[sizes..sizes + 4].copy_from_slice(&1u32.to_be_bytes());
    film[sizes + 4..sizes + 8].copy_from_slice(&count.to_be_bytes());
    Ok(film)
}

/// A sequence parameter set of H.264 that declares `blocks` macroblocks of 16 pixels per side.
fn vast_sequence(blocks: u32) -> Vec<u8> {
    let mut bits = String::new();
    let golomb = |value: u32| {
        let binary = format!("{:b}", value + 1);
        "0".repeat(binary.len() - 1) + &binary
    };
    for value in [0, 0, 2, 1] {
        bits += &golomb(value);
    }
    bits += "0";
    bits += &(golomb(blocks - 1) + &golomb(blocks - 1));
    // Frames only, no 8x8 inference, no cropping, no display parameters, the end.
    bits += "10001";
    let mut unit = vec![0x67, 66, 0, 40];
    for byte in bits.as_bytes().chunks(8) {
        let ones = (0..8).map(|i| u8::from(byte.get(i) == Some(&b'1')) << (7 - i));
        unit.push(ones.sum());
    }
    unit
}

#[tokio::test(flavor = "multi_thread")]
async fn broken_films_are_named_and_a_good_one_still_goes_through() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = film(&dir.path().join("good"))?;
    let film = std::fs::read(dir.path().join("good/video.mp4"))?;
    let video = |bytes: Vec<u8>| with(&good, "video.mp4", bytes);
    let mut garbled = film.clone();
    let frames = box_at(&garbled, b"mdat")? + 4;
    garbled[frames + 8..frames + 200].fill(0xa5);
    let mut endless = film.clone();
    let moov = box_at(&endless, b"moov")?;
    endless[moov - 4..moov].copy_from_slice(&0x7fff_fff0u32.to_be_bytes());
    let size = (32, 32);
    let vast = mp4(
        size,
        15,
        &vast_sequence(3750),
        &[0x68, 0xce, 0x38, 0x80],
        &vec![vec![0; 40]; 4],
    );
    let cut = film[..film.len() / 2].to_vec();
    let cases = vec![
        Case::new("cut", video(cut), "UNDECODABLE", "video.mp4: MP4: "),
        Case::new("empty", video(Vec::new()), "EMPTY", "video.mp4: "),
        Case::new(
            "a picture",
            video(png_bomb(9)?),
            "UNDECODABLE",
            "video.mp4: is a PNG picture",
        ),
        Case::new(
            "a text",
            video(b"poses".repeat(99)),
            "UNDECODABLE",
            "video.mp4: is ",
        ),
        Case::new(
            "a million frames",
            video(declaring(&film, 1_000_000)?),
            "TOO_LARGE",
            "video.mp4: the video has more than 100000 frames",
        ),
        Case::new(
            "four milliard frames",
            video(declaring(&film, u32::MAX)?),
            "TOO_LARGE",
            "video.mp4: the video has more than 100000 frames",
        ),
        Case::new(
            "60 000 pixels",
            video(vast),
            "TOO_LARGE",
            "video.mp4: declares 60000x60000",
        ),
        Case::new(
            "an endless box",
            video(endless),
            "UNDECODABLE",
            "video.mp4: MP4: ",
        ),
        Case::new("garbled", video(garbled), "UNDECODABLE", "video.mp4 frame "),
        Case::new(
            "no mask",
            without(&good, "masks/000001.png"),
            "MISSING",
            "masks/000001.png frame 1: ",
        ),
        Case::new(
            "of another size",
            with(&good, "poses.json", resized(&good)?),
            "SIZE_MISMATCH",
            "video.mp4 frame 0: 32x32 pixels, image_size says 48x48",
        ),
        Case::new(
            "a plan with a typo",
            with(&good, "media.json", *br#"{"evry": 2}"#),
            "UNREADABLE",
            "media.json: line 1 ",
        ),
        Case::new(
            "a plan that leads outside",
            with(
                &good,
                "media.json",
                *br#"{"images": "../../../etc/passwd"}"#,
            ),
            "MISSING",
            "media.json: images: ",
        ),
        Case::new(
            "a plan of nothing",
            with(&good, "media.json", *br#"{"selection": {"first": 9}}"#),
            "EMPTY",
            "media.json: selection: ",
        ),
    ];
    all_are_rejected(dir.path(), cases, good).await
}

/// The track of `good` for images of 48x48.
fn resized(good: &[UploadFile]) -> anyhow::Result<Vec<u8>> {
    let mut track = super::poses::track_of(good)?;
    track["image_size"] = serde_json::json!([48, 48]);
    Ok(track.to_string().into_bytes())
}

#[tokio::test(flavor = "multi_thread")]
async fn broken_pictures_are_named_by_file_and_frame() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = pictures(&dir.path().join("good"))?;
    film(&dir.path().join("film"))?;
    let film = std::fs::read(dir.path().join("film/video.mp4"))?;
    let png = std::fs::read(dir.path().join("good/frames/000002.png"))?;
    let mut twice = good.clone();
    twice.push(yoto_tests::upload::file("frames/shot_2.png", png.clone()));
    let frame = |bytes: Vec<u8>| with(&good, "frames/000002.png", bytes);
    let mask = |bytes: Vec<u8>| with(&good, "masks/000002.png", bytes);
    let (frame_2, mask_2) = ("frames/000002.png frame 2: ", "masks/000002.png frame 2: ");
    let cases = vec![
        Case::new(
            "cut",
            frame(png[..png.len() / 2].to_vec()),
            "UNDECODABLE",
            frame_2,
        ),
        Case::new("empty", frame(Vec::new()), "EMPTY", frame_2),
        Case::new("a film", frame(film), "UNDECODABLE", frame_2),
        Case::new(
            "60 000 pixels",
            frame(png_bomb(60_000)?),
            "TOO_LARGE",
            frame_2,
        ),
        Case::new("mask: empty", mask(Vec::new()), "EMPTY", mask_2),
        Case::new(
            "mask: a text",
            mask(b"0 0 1 1".to_vec()),
            "UNDECODABLE",
            mask_2,
        ),
        Case::new(
            "mask: 60 000 pixels",
            mask(png_bomb(60_000)?),
            "TOO_LARGE",
            mask_2,
        ),
        Case::new("mask: small", mask(png_bomb(1)?), "SIZE_MISMATCH", mask_2),
        Case::new(
            "missing",
            without(&good, "frames/000002.png"),
            "MISSING",
            frame_2,
        ),
        Case::new("twice", twice, "DUPLICATE", "frames/shot_2.png frame 2: "),
        Case::new(
            "no picture at all",
            without(&good, "frames/"),
            "MISSING",
            "media.json: images: ",
        ),
    ];
    all_are_rejected(dir.path(), cases, good).await
}
