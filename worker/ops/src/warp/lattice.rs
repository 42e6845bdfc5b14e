//! Inside a kernel: the position to which a bone carries a point, and the nodes of the grid around
//! it. The counterpart of `grid`.

use super::WarpGrid;
use cubecl::prelude::*;

/// The grid of motion weights.
#[derive(CubeType, CubeLaunch)]
pub(super) struct Lattice {
    /// Smallest corner, metres.
    pub min_x: f32,
    pub min_y: f32,
    pub min_z: f32,
    /// Cells per metre.
    pub scale_x: f32,
    pub scale_y: f32,
    pub scale_z: f32,
    /// Nodes along each axis.
    pub nodes_x: u32,
    pub nodes_y: u32,
    pub nodes_z: u32,
}

/// `grid` as a kernel's argument.
pub(super) fn lattice(grid: &WarpGrid) -> LatticeLaunch {
    let ([x, y, z], [sx, sy, sz]) = (grid.min, grid.scale());
    let [across, down, deep] = grid.nodes.map(|count| count as u32);
    LatticeLaunch::new(x, y, z, sx, sy, sz, across, down, deep)
}

/// A point as a bone carries it, or where it is.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Place {
    /// Whether the point is in the bone's support, or in the box. The rest is meaningful only then.
    pub inside: bool,
    /// Metres.
    pub x: f32,
    pub y: f32,
    pub z: f32,
    /// Lowest node of its cell, from −1.
    pub i: i32,
    pub j: i32,
    pub k: i32,
    /// Offset from that node, cells.
    pub u: f32,
    pub v: f32,
    pub w: f32,
}

/// One of the eight nodes of a cell.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Tap {
    /// Whether the grid has it; weights outside the grid are 0.
    pub inside: bool,
    /// Its number in a bone's volume.
    pub node: usize,
    /// Its share along each axis.
    pub u: f32,
    pub v: f32,
    pub w: f32,
    /// Derivatives of the shares with respect to the offset.
    pub du: f32,
    pub dv: f32,
    pub dw: f32,
}

/// One coordinate of a carried point, by the row of the transform that begins at `at`.
#[cube]
fn carried(transforms: &[f32], at: usize, x: f32, y: f32, z: f32) -> f32 {
    transforms[at] * x + transforms[at + 1] * y + transforms[at + 2] * z + transforms[at + 3]
}

/// Whether `g`, in cells, is within a cell of the nodes from `low` to `high`.
#[cube]
fn near(g: f32, low: u32, high: u32) -> bool {
    g > f32::cast_from(low) - 1.0 && g < f32::cast_from(high) + 1.0
}

/// The place x, y, z, inside if it is less than a cell from the nodes from `low` to `high`.
#[cube]
#[allow(clippy::too_many_arguments)]
fn cell(
    x: f32,
    y: f32,
    z: f32,
    low_i: u32,
    low_j: u32,
    low_k: u32,
    high_i: u32,
    high_j: u32,
    high_k: u32,
    lattice: &Lattice,
) -> Place {
    let gx = (x - lattice.min_x) * lattice.scale_x;
    let gy = (y - lattice.min_y) * lattice.scale_y;
    let gz = (z - lattice.min_z) * lattice.scale_z;
    let low_x = f32::floor(gx);
    let low_y = f32::floor(gy);
    let low_z = f32::floor(gz);
    Place {
        inside: near(gx, low_i, high_i) && near(gy, low_j, high_j) && near(gz, low_k, high_k),
        x,
        y,
        z,
        i: i32::cast_from(low_x),
        j: i32::cast_from(low_y),
        k: i32::cast_from(low_z),
        u: gx - low_x,
        v: gy - low_y,
        w: gz - low_z,
    }
}

/// Point number `point` as bone number `bone` carries it. `supports` `[K, 6]` are the lowest and
/// highest nodes that the bones have weights at.
#[cube]
pub(super) fn place(
    transforms: &[f32],
    points: &[f32],
    supports: &[u32],
    bone: usize,
    point: usize,
    lattice: &Lattice,
) -> Place {
    let px = points[3 * point];
    let py = points[3 * point + 1];
    let pz = points[3 * point + 2];
    let x = carried(transforms, 12 * bone, px, py, pz);
    let y = carried(transforms, 12 * bone + 4, px, py, pz);
    let z = carried(transforms, 12 * bone + 8, px, py, pz);
    let s = 6 * bone;
    cell(
        x,
        y,
        z,
        supports[s],
        supports[s + 1],
        supports[s + 2],
        supports[s + 3],
        supports[s + 4],
        supports[s + 5],
        lattice,
    )
}

/// Point number `point` where it is, inside if it is less than a cell from the box.
#[cube]
pub(super) fn standing(points: &[f32], point: usize, lattice: &Lattice) -> Place {
    cell(
        points[3 * point],
        points[3 * point + 1],
        points[3 * point + 2],
        0u32,
        0u32,
        0u32,
        lattice.nodes_x - 1,
        lattice.nodes_y - 1,
        lattice.nodes_z - 1,
        lattice,
    )
}

/// Number of the grid's nodes.
#[cube]
pub(super) fn voxels(lattice: &Lattice) -> usize {
    usize::cast_from(lattice.nodes_x * lattice.nodes_y * lattice.nodes_z)
}

/// Share of a node along an axis: `part` for the upper one, the rest for the lower one.
#[cube]
fn share(part: f32, upper: i32) -> f32 {
    let mut share = 1.0 - part;
    if upper == 1 {
        share = part;
    }
    share
}

/// Derivative of the share with respect to `part`.
#[cube]
fn slope(upper: i32) -> f32 {
    2.0 * f32::cast_from(upper) - 1.0
}

/// Corner number `corner` of the cell of `place`: bit 0 is x, bit 1 y, bit 2 z.
#[cube]
pub(super) fn tap(place: &Place, corner: u32, lattice: &Lattice) -> Tap {
    let upper_x = i32::cast_from(corner & 1);
    let upper_y = i32::cast_from((corner >> 1) & 1);
    let upper_z = i32::cast_from(corner >> 2);
    let i = place.i + upper_x;
    let j = place.j + upper_y;
    let k = place.k + upper_z;
    let across = i32::cast_from(lattice.nodes_x);
    let down = i32::cast_from(lattice.nodes_y);
    let deep = i32::cast_from(lattice.nodes_z);
    let inside = i >= 0 && j >= 0 && k >= 0 && i < across && j < down && k < deep;
    let mut node = 0;
    if inside {
        node = usize::cast_from((k * down + j) * across + i);
    }
    Tap {
        inside,
        node,
        u: share(place.u, upper_x),
        v: share(place.v, upper_y),
        w: share(place.w, upper_z),
        du: slope(upper_x),
        dv: slope(upper_y),
        dw: slope(upper_z),
    }
}
