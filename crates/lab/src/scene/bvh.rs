//! A bounding volume hierarchy, so that a ray tests only a few of thousands of shapes.

use super::ray::{BoundingBox, Ray};
use super::shape::Shape;

/// A bounding volume hierarchy over the shapes of one part; its leaves are ranges of `order`.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Indices of the shapes, grouped by leaf.
    order: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: BoundingBox,
    /// For a leaf, its start in `order`. For an inner node, the index of its second child; the first one is the next
    /// node.
    first: u32,
    /// Number of shapes in a leaf; 0 for an inner node.
    count: u32,
    /// Axis along which an inner node was split.
    axis: usize,
}

/// A node of at most this many shapes is a leaf.
const LEAF_SHAPES: usize = 3;
/// Number of equal slices between which a node can be split.
const BUCKETS: usize = 12;

impl Bvh {
    /// Builds the tree over `shapes`.
    pub fn new(shapes: &[Shape]) -> Self {
        let boxes: Vec<BoundingBox> = shapes.iter().map(Shape::bounds).collect();
        let mut tree = Self { nodes: Vec::new(), order: (0..shapes.len() as u32).collect() };
        if !shapes.is_empty() {
            tree.split(&boxes, 0, shapes.len());
        }
        tree
    }

    /// Returns the bounding box of all shapes.
    pub fn bounds(&self) -> BoundingBox {
        self.nodes.first().map_or(BoundingBox::EMPTY, |root| root.bounds)
    }

    /// Adds the nodes for `order[start..end]`, and sorts that range. Splits along the longest axis where the surface
    /// area heuristic (sum of area times number of shapes of both sides) is minimal; binned SAH, Wald 2007.
    fn split(&mut self, boxes: &[BoundingBox], start: usize, end: usize) {
        let box_of = |shape: &u32| boxes[*shape as usize];
        let bounds = self.order[start..end].iter().map(box_of).fold(BoundingBox::EMPTY, BoundingBox::union);
        let centres = self.order[start..end].iter().map(box_of).fold(BoundingBox::EMPTY, |all, b| {
            let c = b.centre();
            all.union(BoundingBox { low: c, high: c })
        });
        let extent = centres.high - centres.low;
        let axis = if extent.x >= extent.y && extent.x >= extent.z {
            0
        } else if extent.y >= extent.z {
            1
        } else {
            2
        };
        let index = self.nodes.len();
        self.nodes.push(Node { bounds, first: start as u32, count: (end - start) as u32, axis });
        if end - start <= LEAF_SHAPES || extent[axis] <= 0.0 {
            return;
        }
        let bucket = |b: &BoundingBox| {
            (((b.centre()[axis] - centres.low[axis]) / extent[axis] * BUCKETS as f32) as usize).min(BUCKETS - 1)
        };
        let mut filled = [(BoundingBox::EMPTY, 0usize); BUCKETS];
        for shape in &self.order[start..end] {
            let b = box_of(shape);
            let slot = &mut filled[bucket(&b)];
            *slot = (slot.0.union(b), slot.1 + 1);
        }
        let cost = |part: &[(BoundingBox, usize)]| {
            let (b, n) = part.iter().fold((BoundingBox::EMPTY, 0), |(b, n), s| (b.union(s.0), n + s.1));
            if n == 0 { f32::INFINITY } else { b.half_area() * n as f32 }
        };
        let cost_at = |at: usize| cost(&filled[..at]) + cost(&filled[at..]);
        let Some(at) = (1..BUCKETS).min_by(|a, b| cost_at(*a).total_cmp(&cost_at(*b))) else { return };
        self.order[start..end].sort_by_key(|shape| bucket(&box_of(shape)));
        let middle = start + filled[..at].iter().map(|s| s.1).sum::<usize>();
        // From here on it is an inner node: its first child comes right after it.
        self.nodes[index].count = 0;
        self.split(boxes, start, middle);
        self.nodes[index].first = self.nodes.len() as u32;
        self.split(boxes, middle, end);
    }

    /// Returns the nearest hit before `t_max`: `t` and the shape's index.
    pub fn intersect(&self, shapes: &[Shape], ray: &Ray, mut t_max: f32) -> Option<(f32, u32)> {
        let mut found = None;
        // At most one entry per level of the tree and one more; trees over hundreds of shapes have about 20 levels.
        let mut stack = [0u32; 64];
        let mut stacked = usize::from(!self.nodes.is_empty());
        while stacked > 0 {
            stacked -= 1;
            let index = stack[stacked];
            let node = &self.nodes[index as usize];
            if node.bounds.intersect_ray(ray, t_max).is_none() {
                continue;
            }
            if node.count > 0 {
                for shape in &self.order[node.first as usize..(node.first + node.count) as usize] {
                    if let Some(t) = shapes[*shape as usize].intersect(ray, t_max) {
                        (t_max, found) = (t, Some((t, *shape)));
                    }
                }
            } else {
                // The near child is pushed last, so it is visited first.
                let (near, far) =
                    if ray.direction[node.axis] > 0.0 { (index + 1, node.first) } else { (node.first, index + 1) };
                stack[stacked] = far;
                stack[stacked + 1] = near;
                stacked += 2;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::noise::Rng;
    use glam::Vec3;

    #[test]
    fn the_tree_finds_what_testing_every_shape_finds() {
        let mut rng = Rng::new(1);
        let mut point = |scale: f32| scale * Vec3::new(rng.next() - 0.5, rng.next() - 0.5, rng.next() - 0.5);
        let shapes: Vec<Shape> = (0..500)
            .map(|_| {
                let a = point(4.0) + 5.0 * Vec3::Z;
                Shape::Cone { a, b: a + point(0.8), radius_a: 0.03, radius_b: 0.01 }
            })
            .collect();
        let tree = Bvh::new(&shapes);
        let mut hits = 0;
        for _ in 0..2000 {
            let ray = Ray::new(Vec3::ZERO, point(1.0) + Vec3::Z);
            let every = shapes.iter().filter_map(|s| s.intersect(&ray, f32::INFINITY)).fold(f32::INFINITY, f32::min);
            let found = tree.intersect(&shapes, &ray, f32::INFINITY).map_or(f32::INFINITY, |hit| hit.0);
            assert_eq!(found, every);
            hits += usize::from(every.is_finite());
        }
        assert!(hits > 200, "the rays must meet something: {hits}");
    }
}
