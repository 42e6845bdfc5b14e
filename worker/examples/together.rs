//! People of several models in one picture, whether they consist of fields or of splats:
//!
//! ```text
//! cargo run -p yoto-worker --example together -- OUT.png SIZE MODEL-DIR SLOT [MODEL-DIR SLOT …]
//! ```
//!
//! A model is a folder of `yoto model export` or `yoto distill`. Everybody is in the rest pose; each stands 0.35 m
//! to the right of the one before and 0.5 m behind.

use std::path::Path;
use yoto_avatar::render::{Actor, Guest, Light, Renderer, render_together};
use yoto_capture::camera::{Camera, Pose};
use yoto_media::png::{self, Pixels};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [out, size, people @ ..] = arguments.as_slice() else {
        return Err("OUT.png SIZE MODEL-DIR SLOT are needed".into());
    };
    let size: u32 = size.parse()?;
    let device = yoto_device::pick().device;
    let mut cast = Vec::new();
    for (index, person) in people.chunks(2).enumerate() {
        let [folder, slot] = person else {
            return Err("each MODEL-DIR needs a SLOT".into());
        };
        let (model, slot) = (Renderer::load(Path::new(folder), &device)?, slot.parse()?);
        let skeleton = model.skeleton(slot).ok_or("no such slot")?;
        // Rest joints may be anywhere: each person's root is moved over the origin.
        let [x, y, z] = skeleton.root();
        let mut pose = Pose::rest(skeleton.joints());
        let index = index as f64;
        let to = [0.35 * index - x, -y, -0.5 * index - z];
        pose.translation = to.map(|v| v as f32);
        let light = Light::Own;
        cast.push((model, Actor { slot, pose, light }));
    }
    let guests: Vec<Guest<'_>> = (cast.iter())
        .map(|(model, actor)| Guest { model, actor })
        .collect();
    let middle = 0.175 * (guests.len().max(1) - 1) as f64;
    let camera = Camera::look_at(
        [middle, 0.0, 3.2],
        [middle, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        1.3 * f64::from(size),
        size,
        size,
    );
    let drawn = render_together(&guests, &camera, [1.0; 3], &mut |_| true)?;
    std::fs::write(out, png::encode(Pixels::Rgb, size, size, &drawn.to_rgb8())?)?;
    Ok(())
}
