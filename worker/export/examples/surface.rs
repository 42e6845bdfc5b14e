//! The distance of a synthetic person's mesh from the surface that was filmed:
//!
//! ```text
//! cargo run -p yoto-export --example surface -- MODEL-DIR SLOT PEOPLE SEED
//! ```
//!
//! The model is one of `yoto demo --subjects PEOPLE --seed SEED`, fetched by `yoto model export`.

use std::path::Path;
use yoto_avatar::render::Renderer;
use yoto_export::mesh::{MeshOptions, mesh};
use yoto_synthetic::SyntheticPerson;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, slot, people, seed] = arguments.as_slice() else {
        return Err("MODEL-DIR SLOT PEOPLE SEED are needed".into());
    };
    let slot: usize = slot.parse()?;
    let cast = SyntheticPerson::cast(people.parse()?, seed.parse()?);
    let filmed = cast.get(slot).ok_or("no such person")?;
    let renderer = Renderer::load(Path::new(model), &burn::tensor::Device::flex())?;
    let person = renderer
        .skinned_splats(slot)?
        .ok_or("a model without splats")?;
    let mesh = mesh(&person, &[], &MeshOptions::default())?;
    let distance = |point: &[f32; 3]| 1000.0 * filmed.distance_at_rest(point.map(f64::from));
    let mut off: Vec<f64> = mesh.positions.iter().map(distance).collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    off.iter_mut()
        .for_each(|distance| *distance = distance.abs());
    off.sort_by(f64::total_cmp);
    let part = |share: f64| off[((off.len() - 1) as f64 * share) as usize];
    println!(
        "{}: {} vertices, distance to the filmed surface: median {:.1} mm, 95th percentile {:.1} mm, \
         largest {:.1} mm, mean outward {mean:.1} mm",
        filmed.name(),
        off.len(),
        part(0.5),
        part(0.95),
        part(1.0),
    );
    Ok(())
}
