"""The renderer: from bodies, poses and an appearance to labels and a picture. Only these packages import warp.

`renderer.Renderer` is its interface: `observe` a pose once, then `shade` it in each weather.
The packages, each of which imports only those above it:

    device     Warp, set up so that every machine computes the same bytes; arrays, structs, launches
    numeric    scalars, vectors, noise
    scene      all bodies' triangles on the device; the pinhole camera
    raster     which triangle every pixel sees, and the labels that follow; the lens's distortion
    texture    patterns, images and colours of surfaces
    sampling   the points that are shaded, and the geometry at each
    atmosphere the air: fog, sky, the light of sun and weather
    shadows    shadow maps of the sun
    lighting   lamps, materials, reflections, the light of every sample; what is kept from frame to frame
    camera     rain, exposure, tone, noise, and the effects of lens and shutter
    gpu        many frames of one camera: kernels recorded once and replayed

Modules named `*_kernels` contain kernels; host code is in the modules next to them.
"""
