//! dev
use bokehcam::frame::*; use bokehcam::scene::*;
fn main(){
 let a:Vec<String>=std::env::args().collect();
 let s=Scene::portrait();
 let k:u32=a[1].parse().unwrap(); let spp:u32=a[2].parse().unwrap(); let t:f64=a[3].parse().unwrap();
 let mut v=View::new(640*k,360*k);
 if a.len()>5 { // crop x,y,zoom
   let z:f32=a[5].parse().unwrap(); v.focal_px*=z;
 }
 let (mut c,mut d)=(ColorImage::default(),DepthMap::default());
 let now=std::time::Instant::now();
 if a.len()>6 { let n:usize=a[6].parse().unwrap(); let pts=lens_points(n,|_|true);
  let p=s.render_thin_lens(&v,t,&ThinLens{coc_at_infinity_px:14.0,focus_m:s.focus_m(),aperture:&pts},2);
  eprintln!("{:?}",now.elapsed());
  let c=p.hdr.to_srgb(); image::save_buffer(&a[4],&c.rgb,c.width,c.height,image::ColorType::Rgb8).unwrap(); return; }
 s.render_pinhole(&v,t,spp,2,&mut c,&mut d);
 eprintln!("{:?}",now.elapsed());
 image::save_buffer(&a[4],&c.rgb,c.width,c.height,image::ColorType::Rgb8).unwrap();
}
