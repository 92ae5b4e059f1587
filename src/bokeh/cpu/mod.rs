//! The CPU executor: every core, the best vector instructions that the machine has, nothing allocated per frame.

mod aligned;
mod bin;
mod blur;
mod composite;
mod fill;
mod gather;
mod probe;
mod reach;
mod rows;
mod shelves;
mod simd;
mod team;
mod unpack;

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use aligned::Aligned;
use bin::BinBand;
use blur::{GROUP, Scratch, Strip};
use pulp::Arch;
use rows::{BinRows, MARGIN, Rows, STRIP, TILE_H, TILE_W};
use shelves::{BinShelves, StripShelves};
use team::{Shelf, Team};
use unpack::Unpack;

use super::plan::{CELL, Compositing, MAX_BINS, Plan, Share};
use super::{Bokeh, BokehError, Finished, Job, PassTimes};
use crate::frame::{ColorImage, DepthMap};
use crate::optics::CocField;

pub use unpack::{linear_to_srgb, srgb_to_linear};

/// Runs a plan on the CPU.
pub struct CpuBokeh {
    plan: Plan,
    arch: Arch,
    team: Team,
    decode: [f32; 256],
    encode: Vec<u8>,
    scene: Rows<4>,
    tiles: Vec<(f32, f32)>,
    shares: Vec<Share>,
    bins: Vec<BinRows>,
    pyramid: Option<fill::Pyramid>,
    gather: Option<Gather>,
    members: Vec<Member>,
    taken: Vec<AtomicBool>,
    taken_too: Vec<AtomicBool>,
    done: Option<Finished>,
}

/// Memory of one thread.
#[derive(Default)]
struct Member {
    blur: Scratch,
    reach: Vec<f32>,
}

/// Rows of the picture that are binned together: a row of cells at every scale fits in whole.
const BAND: usize = 4 * CELL;

/// Memory of the comparison methods.
struct Gather {
    kernels: Vec<[Vec<f32>; 2]>,
    rows: Vec<f32>,
    result: Vec<f32>,
}

impl CpuBokeh {
    /// An executor of `plan` on `threads` threads (all cores when `None`).
    pub fn new(plan: Plan, threads: Option<usize>) -> Self {
        let threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
        let (width, height) = (plan.width, plan.height);
        let team = Team::new(threads);
        let shares = (0..plan.bins.len()).map(|k| plan.share(k)).collect();
        let bins: Vec<BinRows> = plan.bins.iter().map(|bin| BinRows::new(&plan, bin)).collect();
        let tallest = plan.bins.iter().map(|bin| bin.height).max().unwrap_or(0);
        let members = (0..team.threads())
            .map(|_| Member {
                blur: Scratch {
                    rows: Aligned::zeros(tallest * GROUP.min(plan.bank.terms) * 4 * STRIP),
                    filtered: Vec::with_capacity(tallest.div_ceil(CELL)),
                },
                reach: Vec::with_capacity(bins.iter().map(|bin| bin.cells.data.len() * 2).max().unwrap_or(0)),
            })
            .collect();
        let flags = |n: usize| (0..n).map(|_| AtomicBool::new(false)).collect();
        let most = height.max(bins.iter().map(|bin| bin.strips).sum::<usize>());
        let has_near = plan.bins.iter().any(|bin| bin.near);
        let bank = &plan.bank;
        let gather = (plan.compositing == Compositing::Gather).then(|| Gather {
            kernels: if plan.exact {
                (0..bank.nodes).map(|node| [bank.kernel(node, false), bank.kernel(node, true)]).collect()
            } else {
                Vec::new()
            },
            rows: vec![0.0; if plan.exact { 0 } else { width * height * 3 * bank.terms }],
            result: vec![0.0; width * height * 3],
        });
        Self {
            decode: unpack::decode_table(),
            encode: composite::encode_table(),
            scene: Rows::new(width, height, MARGIN),
            tiles: vec![(0.0, 0.0); width.div_ceil(TILE_W) * height.div_ceil(TILE_H)],
            pyramid: (plan.fill && has_near && plan.compositing == Compositing::Layers)
                .then(|| fill::Pyramid::new(width, height)),
            arch: Arch::new(),
            taken: flags(most),
            taken_too: flags(most),
            plan,
            team,
            shares,
            bins,
            gather,
            members,
            done: None,
        }
    }

    /// Blurs one picture.
    ///
    /// # Errors
    /// The picture has another size than the plan, or `coc` needs depth and there is none.
    pub fn blur(
        &mut self,
        color: &ColorImage,
        depth: Option<&DepthMap>,
        coc: &CocField,
        out: &mut ColorImage,
    ) -> Result<PassTimes, BokehError> {
        let made_for = (self.plan.width as u32, self.plan.height as u32);
        if color.size() != made_for {
            return Err(BokehError::Size { made_for, got: color.size() });
        }
        if matches!(coc, CocField::Depth(_)) && depth.is_none() {
            return Err(BokehError::NoDepth);
        }
        out.resize(color.width, color.height);
        let mut times = PassTimes::new();
        if out.rgb.is_empty() {
            return Ok(times);
        }
        let mut clock = Instant::now();
        let mut lap = |name| {
            let now = Instant::now();
            times.add(name, now - clock);
            clock = now;
        };
        self.unpack(color, depth, coc);
        lap("unpack");
        self.bin(|bin| bin.near);
        lap("bin");
        self.fill();
        lap("fill");
        self.bin(|bin| !bin.near);
        lap("bin");
        if self.plan.compositing == Compositing::Gather {
            self.gather();
            lap("gather");
        } else {
            self.reach();
            lap("reach");
            self.blur_bins();
            lap("blur");
        }
        self.composite(out);
        lap("composite");
        Ok(times)
    }

    fn unpack(&mut self, color: &ColorImage, depth: Option<&DepthMap>, coc: &CocField) {
        let across = self.plan.width.div_ceil(TILE_W);
        let stride = self.scene.stride;
        let band = TILE_H * self.scene.row_len();
        let out = Shelf::new(&mut self.scene.data, band, &mut self.taken);
        let tiles = Shelf::new(&mut self.tiles, across, &mut self.taken_too);
        let (arch, table, expansion) = (self.arch, &self.decode, self.plan.expansion);
        self.team.run(self.plan.height.div_ceil(TILE_H), &|part| {
            arch.dispatch(Unpack {
                color,
                depth,
                coc,
                table,
                expansion,
                y0: part * TILE_H,
                out: out.part(part),
                stride,
                tiles: tiles.part(part),
            });
        });
    }

    fn bin(&mut self, which: impl Fn(&super::plan::Bin) -> bool) {
        let whole = self.plan.compositing != Compositing::Layers;
        let across = self.plan.width.div_ceil(TILE_W);
        let (arch, scene, tiles) = (self.arch, &self.scene, &self.tiles);
        let size = (self.plan.width, self.plan.height);
        let mut shelves: [Option<BinShelves<'_>>; MAX_BINS] = [const { None }; MAX_BINS];
        for (k, (bin, rows)) in self.plan.bins.iter().zip(&mut self.bins).enumerate() {
            if which(bin) {
                rows.present = tiles.iter().any(|&tile| self.shares[k].meets(tile));
                shelves[k] = rows.present.then(|| BinShelves::new(rows, across));
            }
        }
        // A part is the same rows of the picture for every bin, so that they stay in the cache.
        self.team.run(size.1.div_ceil(BAND), &|part| {
            for (k, bin) in self.plan.bins.iter().enumerate() {
                let Some(shelf) = &shelves[k] else { continue };
                let bands = BAND / (CELL * bin.scale);
                for band in part * bands..((part + 1) * bands).min(bin.height.div_ceil(CELL)) {
                    arch.dispatch(BinBand {
                        scene,
                        size,
                        tiles,
                        share: (!whole).then_some(self.shares[k]),
                        scale: bin.scale,
                        band,
                        width: bin.width,
                        out: shelf.source.part(band),
                        stride: shelf.stride,
                        pad: shelf.pad,
                        cells: shelf.cells.part(band),
                        filled: shelf.filled.part(band),
                    });
                }
            }
        });
    }

    fn fill(&mut self) {
        let Some(pyramid) = &mut self.pyramid else { return };
        let near = self.plan.bins.iter().zip(&self.bins).filter(|(bin, _)| bin.near);
        if !near.into_iter().any(|(_, rows)| rows.present) {
            return;
        }
        let Some(index) = self.plan.bins.iter().rposition(|bin| bin.near) else { return };
        let behind = self.plan.rest_share();
        let nearest_px = self.plan.bins[index].high_px;
        pyramid.fill(&mut self.team, &mut self.scene, (self.plan.width, self.plan.height), behind, nearest_px);
        // What was filled in has another CoC: find the tiles' ranges anew.
        let (across, scene) = (self.plan.width.div_ceil(TILE_W), &self.scene);
        let (width, height) = (self.plan.width, self.plan.height);
        let tiles = Shelf::new(&mut self.tiles, across, &mut self.taken);
        self.team.run(height.div_ceil(TILE_H), &|part| {
            let tiles = tiles.part(part);
            tiles.fill((f32::INFINITY, f32::NEG_INFINITY));
            for y in part * TILE_H..((part + 1) * TILE_H).min(height) {
                unpack::widen(tiles, &scene.plane(y, 3)[..width]);
            }
        });
    }

    fn reach(&mut self) {
        let plan = &self.plan;
        let parts = Shelf::new(&mut self.bins, 1, &mut self.taken);
        self.team.run_with(&mut self.members, plan.bins.len(), &|member: &mut Member, part| {
            for rows in parts.part(part).iter_mut().filter(|rows| rows.present) {
                reach::reach(plan, &plan.bins[part], &rows.cells, &mut rows.edges, &mut member.reach);
            }
        });
    }

    fn blur_bins(&mut self) {
        let (plan, arch) = (&self.plan, self.arch);
        let mut shelves: [Option<StripShelves<'_>>; MAX_BINS] = [const { None }; MAX_BINS];
        let mut parts = 0;
        for ((bin, rows), shelf) in plan.bins.iter().zip(&mut self.bins).zip(&mut shelves) {
            if rows.present {
                *shelf = Some(StripShelves::new(bin, rows, parts));
                parts += bin.width.div_ceil(STRIP);
            }
        }
        self.team.run_with(&mut self.members, parts, &|member: &mut Member, part| {
            let mut all = shelves.iter().zip(&plan.bins).filter_map(|(shelf, bin)| shelf.as_ref().zip(Some(bin)));
            let Some((shelf, bin)) = all.rfind(|(shelf, _)| shelf.first <= part) else { return };
            let strip = part - shelf.first;
            arch.dispatch(Strip {
                source: &shelf.source.data,
                stride: shelf.source.stride,
                pad: shelf.source.pad,
                height: bin.height,
                cells: shelf.cells,
                edges: shelf.edges,
                bank: &plan.bank,
                turned: bin.near,
                reach: plan.bank.node_reach[plan.bank.node(bin.max_radius_px)] as usize,
                strip,
                out: shelf.out.part(strip),
                active: shelf.active.part(strip),
                scratch: &mut member.blur,
            });
        });
    }

    fn gather(&mut self) {
        let Some(gather) = &mut self.gather else { return };
        let (size, arch, bank) = ((self.plan.width, self.plan.height), self.arch, &*self.plan.bank);
        let (source, scene) = (&self.bins[0].source, &self.scene);
        let coc = |y: usize| scene.plane(y, 3);
        if self.plan.exact {
            let out = Shelf::new(&mut gather.result, 3 * size.0, &mut self.taken);
            let kernels = &gather.kernels;
            self.team.run(size.1, &|y| {
                arch.dispatch(gather::Exact { source, size, kernels, bank, coc: coc(y), y, out: out.part(y) });
            });
            return;
        }
        let rows = Shelf::new(&mut gather.rows, bank.terms * 3 * size.0, &mut self.taken);
        self.team.run(size.1, &|y| {
            arch.dispatch(gather::GatherRow { source, width: size.0, bank, coc: coc(y), y, out: rows.part(y) });
        });
        let out = Shelf::new(&mut gather.result, 3 * size.0, &mut self.taken);
        let rows = &gather.rows;
        self.team.run(size.1, &|y| {
            arch.dispatch(gather::GatherColumn { rows, size, bank, coc: coc(y), y, out: out.part(y) });
        });
    }

    fn composite(&mut self, out: &mut ColorImage) {
        let width = self.plan.width;
        let out = Shelf::new(&mut out.rgb, TILE_H * width * 3, &mut self.taken);
        let gathered = self.gather.as_ref().map_or(&[][..], |gather| &gather.result);
        let (plan, bins, shares, scene) = (&self.plan, &self.bins, &self.shares, &self.scene);
        let (arch, encode) = (self.arch, &self.encode);
        self.team.run(self.plan.height.div_ceil(TILE_H), &|part| {
            let y0 = part * TILE_H;
            let out = out.part(part);
            arch.dispatch(composite::Composite { plan, bins, shares, scene, gathered, encode, y0, out });
        });
    }
}

impl Bokeh for CpuBokeh {
    fn submit(&mut self, mut job: Job) -> Result<(), BokehError> {
        let times = self.blur(&job.color, job.depth.as_deref(), &job.coc, &mut job.out)?;
        self.done = Some(Finished { ticket: job.ticket, out: job.out, times });
        Ok(())
    }

    fn collect(&mut self, _wait: bool) -> Result<Option<Finished>, BokehError> {
        Ok(self.done.take())
    }

    fn in_flight(&self) -> usize {
        usize::from(self.done.is_some())
    }

    fn capacity(&self) -> usize {
        1
    }

    fn describe(&self) -> String {
        format!("cpu, {} threads, {}", self.team.threads(), simd::name(self.arch))
    }
}
