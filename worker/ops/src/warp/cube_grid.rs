//! Inside a kernel: the position to which a bone transforms a point, and the nodes of the grid around
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

/// A point that a bone has transformed, or the point as it is, with its cell in the grid.
#[derive(CubeType, Clone, Copy)]
pub(super) struct GridPoint {
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
    /// Its index in a bone's volume.
    pub node: usize,
    /// Its trilinear weight along each axis.
    pub u: f32,
    pub v: f32,
    pub w: f32,
    /// Derivatives of these weights with respect to the offset.
    pub du: f32,
    pub dv: f32,
    pub dw: f32,
}

/// One coordinate of a transformed point, by the row of the transform that begins at `at`.
#[cube]
fn transform_row(transforms: &[f32], at: usize, x: f32, y: f32, z: f32) -> f32 {
    transforms[at] * x + transforms[at + 1] * y + transforms[at + 2] * z + transforms[at + 3]
}

/// Whether `g`, in cells, is within a cell of the nodes from `low` to `high`.
#[cube]
fn within_a_cell(g: f32, low: u32, high: u32) -> bool {
    g > f32::cast_from(low) - 1.0 && g < f32::cast_from(high) + 1.0
}

/// The point x, y, z, which is inside if it is less than a cell from the nodes from `low` to `high`.
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
) -> GridPoint {
    let gx = (x - lattice.min_x) * lattice.scale_x;
    let gy = (y - lattice.min_y) * lattice.scale_y;
    let gz = (z - lattice.min_z) * lattice.scale_z;
    let low_x = f32::floor(gx);
    let low_y = f32::floor(gy);
    let low_z = f32::floor(gz);
    GridPoint {
        inside: within_a_cell(gx, low_i, high_i)
            && within_a_cell(gy, low_j, high_j)
            && within_a_cell(gz, low_k, high_k),
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

/// The point with index `index`, transformed by the bone with index `bone`. `supports` `[K, 6]` are the lowest and
/// highest nodes where the bones have weights.
#[cube]
pub(super) fn transformed_point(
    transforms: &[f32],
    points: &[f32],
    supports: &[u32],
    bone: usize,
    index: usize,
    lattice: &Lattice,
) -> GridPoint {
    let px = points[3 * index];
    let py = points[3 * index + 1];
    let pz = points[3 * index + 2];
    let x = transform_row(transforms, 12 * bone, px, py, pz);
    let y = transform_row(transforms, 12 * bone + 4, px, py, pz);
    let z = transform_row(transforms, 12 * bone + 8, px, py, pz);
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

/// The point with index `index` as it is, which is inside if it is less than a cell from the box.
#[cube]
pub(super) fn untransformed_point(points: &[f32], index: usize, lattice: &Lattice) -> GridPoint {
    cell(
        points[3 * index],
        points[3 * index + 1],
        points[3 * index + 2],
        0u32,
        0u32,
        0u32,
        lattice.nodes_x - 1,
        lattice.nodes_y - 1,
        lattice.nodes_z - 1,
        lattice,
    )
}

/// The lowest node of a cell inside the box along an axis with `nodes` nodes, for a place of `g` cells.
#[cube]
fn lowest_inside(g: f32, nodes: u32) -> i32 {
    clamp(i32::cast_from(f32::floor(g)), 0, i32::cast_from(nodes) - 2)
}

/// The point with index `index` as it is, in a cell whose eight nodes are all inside the box. Points at the border of
/// the box are inside.
#[cube]
pub(super) fn point_in_box(points: &[f32], index: usize, lattice: &Lattice) -> GridPoint {
    let x = points[3 * index];
    let y = points[3 * index + 1];
    let z = points[3 * index + 2];
    let gx = (x - lattice.min_x) * lattice.scale_x;
    let gy = (y - lattice.min_y) * lattice.scale_y;
    let gz = (z - lattice.min_z) * lattice.scale_z;
    let i = lowest_inside(gx, lattice.nodes_x);
    let j = lowest_inside(gy, lattice.nodes_y);
    let k = lowest_inside(gz, lattice.nodes_z);
    GridPoint {
        inside: gx >= 0.0
            && gy >= 0.0
            && gz >= 0.0
            && gx <= f32::cast_from(lattice.nodes_x - 1)
            && gy <= f32::cast_from(lattice.nodes_y - 1)
            && gz <= f32::cast_from(lattice.nodes_z - 1),
        x,
        y,
        z,
        i,
        j,
        k,
        u: gx - f32::cast_from(i),
        v: gy - f32::cast_from(j),
        w: gz - f32::cast_from(k),
    }
}

/// Number of the grid's nodes.
#[cube]
pub(super) fn voxels(lattice: &Lattice) -> usize {
    usize::cast_from(lattice.nodes_x * lattice.nodes_y * lattice.nodes_z)
}

/// Linear weight of a node along an axis: `part` for the upper one, the rest for the lower one.
#[cube]
fn node_weight(part: f32, upper: i32) -> f32 {
    let mut weight = 1.0 - part;
    if upper == 1 {
        weight = part;
    }
    weight
}

/// Derivative of the weight with respect to `part`.
#[cube]
fn node_weight_derivative(upper: i32) -> f32 {
    2.0 * f32::cast_from(upper) - 1.0
}

/// A corner of the cell of `point`: bit 0 of `corner` is x, bit 1 y, bit 2 z.
#[cube]
pub(super) fn tap(point: &GridPoint, corner: u32, lattice: &Lattice) -> Tap {
    let upper_x = i32::cast_from(corner & 1);
    let upper_y = i32::cast_from((corner >> 1) & 1);
    let upper_z = i32::cast_from(corner >> 2);
    let i = point.i + upper_x;
    let j = point.j + upper_y;
    let k = point.k + upper_z;
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
        u: node_weight(point.u, upper_x),
        v: node_weight(point.v, upper_y),
        w: node_weight(point.w, upper_z),
        du: node_weight_derivative(upper_x),
        dv: node_weight_derivative(upper_y),
        dw: node_weight_derivative(upper_z),
    }
}
