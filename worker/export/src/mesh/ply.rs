//! A mesh as a `.ply` file with a colour per vertex.

use super::Mesh;
use std::io::{self, Write};

/// Writes `mesh`, binary, with the texture's colour at each vertex.
///
/// # Errors
/// If writing fails.
pub fn write(to: &mut impl Write, mesh: &Mesh) -> io::Result<()> {
    let (vertices, faces) = (mesh.positions.len(), mesh.triangles.len());
    write!(
        to,
        "ply\nformat binary_little_endian 1.0\ncomment metres, y up\nelement vertex {vertices}\n\
         property float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )?;
    let vertices = mesh.positions.iter().zip(&mesh.normals);
    for ((position, normal), at) in vertices.zip(&mesh.coordinates) {
        for value in position.iter().chain(normal) {
            to.write_all(&value.to_le_bytes())?;
        }
        to.write_all(&texel(mesh, *at))?;
    }
    for triangle in &mesh.triangles {
        to.write_all(&[3])?;
        for corner in triangle {
            to.write_all(&corner.to_le_bytes())?;
        }
    }
    Ok(())
}

/// The colour of the texture's pixel at the coordinates `at`.
fn texel(mesh: &Mesh, at: [f32; 2]) -> [u8; 3] {
    let side = mesh.side as usize;
    let [column, row] = at.map(|v| ((v * mesh.side as f32) as usize).min(side - 1));
    mesh.texture
        .get(row * side + column)
        .copied()
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_have_the_texture_s_colours() {
        let mesh = Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]],
            normals: vec![[0.0, 0.0, 1.0]; 3],
            coordinates: vec![[0.1, 0.1], [1.0, 0.1], [0.1, 0.9]],
            bones: vec![[(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]; 3],
            triangles: vec![[0, 1, 2]],
            texture: vec![[1, 2, 3], [4, 5, 6], [7, 8, 9], [0, 0, 0]],
            side: 2,
        };
        let mut file = Vec::new();
        write(&mut file, &mesh).expect("writes");
        let end = b"end_header\n";
        let start = file
            .windows(end.len())
            .position(|it| it == end)
            .expect("a header");
        let body = &file[start + end.len()..];
        assert_eq!(body.len(), 3 * 27 + 13);
        let colours: Vec<&[u8]> = (0..3).map(|i| &body[27 * i + 24..27 * i + 27]).collect();
        assert_eq!(colours, [[1, 2, 3], [4, 5, 6], [7, 8, 9]]);
        assert_eq!(body[81..], [3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    }
}
