//! How fast a model draws one person, and where the time of a picture goes:
//!
//! ```text
//! cargo run -p yoto --example frames -- MODEL-DIR SLOT SIZE [PICTURES]
//! ```
//!
//! The model is a folder of `yoto model export`. The person stands in the rest pose, and the camera goes
//! around them. Prints the median milliseconds of a picture: drawing, rounding to 8 bits, and PNG.

#![allow(clippy::disallowed_macros, reason = "its figures go to the terminal")]

use std::path::Path;
use std::time::Instant;
use yoto_avatar::render::{RenderView, Renderer};
use yoto_capture::camera::{Camera, Pose};
use yoto_media::png::{self, Pixels};

/// That of the `yoto` command: with one that gives memory back, a third of a picture's time is the kernel's.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    yoto::allocator::keep_freed_memory();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (model, slot, size, pictures) = match arguments.as_slice() {
        [model, slot, size] => (model, slot, size, "60"),
        [model, slot, size, pictures] => (model, slot, size, pictures.as_str()),
        _ => return Err("MODEL-DIR SLOT SIZE are needed".into()),
    };
    let (slot, size, pictures): (usize, u32, usize) =
        (slot.parse()?, size.parse()?, pictures.parse()?);
    let renderer = Renderer::load(Path::new(model), &yoto_device::pick().device)?;
    let skeleton = renderer.skeleton(slot).ok_or("no such slot")?;
    let [x, y, z] = skeleton.root();
    let mut times = [Vec::new(), Vec::new(), Vec::new()];
    for place in 0..pictures {
        let around = std::f64::consts::TAU * place as f64 / pictures as f64;
        let eye = [x + 3.0 * around.sin(), y, z + 3.0 * around.cos()];
        let view = RenderView {
            slot,
            pose: Pose::rest(skeleton.joints()),
            camera: Camera::look_at(
                eye,
                [x, y, z],
                [0.0, 1.0, 0.0],
                1.4 * f64::from(size),
                size,
                size,
            ),
            background: [0.0; 3],
        };
        let began = Instant::now();
        let drawn = renderer.render(&view)?;
        let seen = Instant::now();
        let rounded = drawn.to_rgb8();
        let whole = Instant::now();
        let file = png::encode(Pixels::Rgb, size, size, &rounded)?;
        let ends = [(began, seen), (seen, whole), (whole, Instant::now())];
        for (times, (start, end)) in times.iter_mut().zip(ends) {
            times.push(1e3 * (end - start).as_secs_f64());
        }
        if place == 0 {
            println!(
                "{size} x {size}, the first picture has {} bytes as PNG",
                file.len()
            );
        }
    }
    let medians = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    let [draw, round, encode] = medians;
    println!(
        "drawing {draw:.1} ms, rounding {round:.1} ms, PNG {encode:.1} ms: {:.0} pictures per second, {:.0} \
         without PNG",
        1e3 / (draw + round + encode),
        1e3 / (draw + round)
    );
    Ok(())
}
