//! Films can be read again after writing, in their colours.

use yoto_media::Limits;
use yoto_media::film::{Film, FilmError};
use yoto_media::video::{Ffmpeg, Video};

const FRAMES: usize = 40;

/// Red rises to the right, green downwards, and blue with time, around a square that moves.
fn picture(width: usize, height: usize, frame: usize) -> Vec<u8> {
    let pixel = |at: usize| {
        let (row, column) = (at / width, at % width);
        let inside = |position: usize| (frame..frame + 16).contains(&position);
        match inside(row) && inside(column) {
            true => [250, 250, 250],
            false => [
                (40 + 160 * column / width) as u8,
                (40 + 160 * row / height) as u8,
                (40 + 4 * frame) as u8,
            ],
        }
    };
    (0..width * height).flat_map(pixel).collect()
}

#[test]
fn a_film_comes_back_in_its_colours_and_at_its_speed() {
    for (width, height) in [(96, 64), (97, 65)] {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("film.mp4");
        let file = std::fs::File::create(&path).expect("a file");
        let mut film = Film::new(file, width, height, 25.0).expect("a film");
        for frame in 0..FRAMES {
            film.push(&picture(width, height, frame))
                .expect("a picture");
        }
        film.finish().expect("writes");
        let bytes = std::fs::read(&path).expect("a file");
        let offset = |name: &[u8]| bytes.windows(4).position(|part| part == name);
        assert!(
            offset(b"moov") < offset(b"mdat"),
            "players wait for the whole file"
        );

        let mut video =
            Video::open(&path, &Limits::default(), &Ffmpeg::none(), true).expect("a video");
        assert_eq!(video.frames(), Some(FRAMES));
        let times = video.times();
        assert!(
            (times[FRAMES - 1] - (FRAMES - 1) as f64 / 25.0).abs() < 1e-3,
            "{times:?}"
        );
        for frame in 0..FRAMES {
            let read = video.next(false).expect("decodes").expect("a frame");
            let expected = picture(width, height, frame);
            let (mut off, mut colour) = (0.0, 0.0);
            for row in 0..height {
                for column in 0..width {
                    for c in 0..3 {
                        let one = f64::from(expected[3 * (row * width + column) + c]);
                        let other = f64::from(read.rgb[3 * (row * read.width + column) + c]);
                        off += (one - other).powi(2);
                        colour += one - other;
                    }
                }
            }
            let pixels = (3 * width * height) as f64;
            let psnr = 10.0 * (255.0f64.powi(2) * pixels / off).log10();
            assert!(
                psnr > 30.0,
                "{psnr:.1} dB in frame {frame} of {width} x {height}"
            );
            assert!(
                (colour / pixels).abs() < 1.6,
                "the mean is {} off",
                colour / pixels
            );
        }
        assert!(video.next(false).expect("ends").is_none());
    }
}

#[test]
fn pictures_of_another_size_are_refused() {
    let mut film = Film::new(Vec::new(), 8, 8, 25.0).expect("a film");
    let error = film.push(&[0; 3 * 9 * 8]).expect_err("too large");
    assert!(matches!(
        error,
        FilmError::Picture {
            found: 216,
            expected: 192
        }
    ));
    assert!(matches!(
        Film::new(Vec::new(), 0, 8, 25.0),
        Err(FilmError::Size(0, 8))
    ));
}

#[test]
fn no_picture_of_noise_is_left_out() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("film.mp4");
    let file = std::fs::File::create(&path).expect("a file");
    let mut film = Film::new(file, 128, 128, 60.0).expect("a film");
    let mut state = 1u32;
    let mut byte = || {
        // A linear congruential generator (Numerical Recipes).
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    for _ in 0..FRAMES {
        let noise: Vec<u8> = (0..3 * 128 * 128).map(|_| byte()).collect();
        film.push(&noise).expect("a picture");
    }
    film.finish().expect("writes");
    let video = Video::open(&path, &Limits::default(), &Ffmpeg::none(), true).expect("a video");
    assert_eq!(video.frames(), Some(FRAMES));
}
