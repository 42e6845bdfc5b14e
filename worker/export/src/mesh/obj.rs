//! A mesh as an `.obj` file, with files for its material and texture.

use super::Mesh;
use std::fmt::Write;

/// The files of a mesh.
pub struct ObjFiles {
    /// `.obj`: positions, texture coordinates, normals and triangles.
    pub obj: String,
    /// `.mtl`: the material.
    pub mtl: String,
    /// `.png`: the texture.
    pub texture: Vec<u8>,
}

/// The files of `mesh`, named `stem` with their extensions.
///
/// # Errors
/// If the texture can't be written.
pub fn files(mesh: &Mesh, stem: &str) -> Result<ObjFiles, image::ImageError> {
    let mut obj = format!("# metres, y up\nmtllib {stem}.mtl\n");
    // Writing to a String can't fail.
    for [x, y, z] in &mesh.positions {
        let _ = writeln!(obj, "v {x} {y} {z}");
    }
    for [u, v] in &mesh.coordinates {
        // OBJ measures texture coordinates from the lower left corner.
        let _ = writeln!(obj, "vt {u} {}", 1.0 - v);
    }
    for [x, y, z] in &mesh.normals {
        let _ = writeln!(obj, "vn {x} {y} {z}");
    }
    obj.push_str("usemtl person\n");
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| corner + 1);
        let _ = writeln!(obj, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}");
    }
    // The texture includes light, so the material has neither diffuse shading nor highlights.
    let mtl = format!("newmtl person\nillum 0\nKd 1 1 1\nKs 0 0 0\nmap_Kd {stem}.png\n");
    Ok(ObjFiles {
        obj,
        mtl,
        texture: super::glb::png(mesh)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_names_its_place_its_texel_and_its_normal_from_one() {
        let mesh = Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]],
            normals: vec![[0.0, 0.0, 1.0]; 3],
            coordinates: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 0.25]],
            bones: vec![[(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]; 3],
            triangles: vec![[0, 1, 2]],
            texture: vec![[10, 20, 30]; 4],
            side: 2,
        };
        let files = files(&mesh, "ada").expect("writes");
        let lines: Vec<&str> = files.obj.lines().collect();
        for line in [
            "mtllib ada.mtl",
            "v 0 1 0.5",
            "vt 0 0.75",
            "f 1/1/1 2/2/2 3/3/3",
        ] {
            assert!(lines.contains(&line), "{line} in {lines:?}");
        }
        assert!(files.mtl.contains("map_Kd ada.png"));
        let texture = image::load_from_memory(&files.texture)
            .expect("a picture")
            .to_rgb8();
        assert_eq!(texture.get_pixel(1, 1).0, [10, 20, 30]);
    }
}
