// The one table of numbers behind the synthetic scenes. Frequencies and looks are guesses of ours about a usual kitchen.
#include "perception_bridge/kitchen_generator.h"

namespace sherlog {
namespace {

// What the classes below have in common: columns in the order of the contexts, shapes and colours of default_kitchen().
KitchenClass plain(std::string name, std::vector<double> frequency, std::vector<double> shapes,
                   std::vector<double> colors, double big) {
  KitchenClass c;
  c.name = std::move(name);
  c.frequency = std::move(frequency);
  c.shapes = std::move(shapes);
  c.colors = std::move(colors);
  c.big = big;
  return c;
}

// A thing in a printed package.
KitchenClass packaged(KitchenClass c, std::vector<std::string> words, std::string company, std::string product,
                      std::string contact = "") {
  c.words = std::move(words);
  c.company = std::move(company);
  c.product = std::move(product);
  c.contact = std::move(contact);
  c.detectable = true;
  return c;
}

KitchenClass detectable(KitchenClass c) {
  c.detectable = true;
  return c;
}

std::vector<KitchenClass> default_classes() {
  //  name                Breakfast Cooking Drawer Fridge     Round Flat Box   Red Yellow Blue Green White Black   big
  return {
      plain("Bowl", {8, 2, 2, 0}, {.9, .1, 0}, {.1, .1, .25, 0, .5, .05}, .9),
      plain("Cup", {12, 1, 2, 0}, {1, 0, 0}, {.3, .3, .1, .05, .1, .15}, .3),
      plain("Fork", {9, 1, 9, 0}, {.25, .65, .1}, {.3, 0, .4, 0, .1, .2}, .1),
      plain("Knife", {10, 2, 9, 0}, {.25, .65, .1}, {.2, .1, .4, 0, .1, .2}, .05),
      plain("Spoon", {9, 2, 8, 0}, {.3, .6, .1}, {.3, .4, 0, 0, .1, .2}, .1),
      plain("Plate", {14, 2, 6, 0}, {.3, .6, .1}, {.05, .25, .3, 0, .25, .15}, 1),
      plain("Spatula", {0, 9, 9, 0}, {.4, .45, .15}, {.1, .25, 0, 0, .05, .6}, .5),
      plain("Pot", {0, 8, 1, 1}, {.85, 0, .15}, {.1, 0, 0, 0, .5, .4}, 1),
      detectable(plain("Toaster", {4, 0, 0, 0}, {.1, 0, .9}, {.05, .4, 0, 0, .35, .2}, 1)),
      detectable(plain("Hot_plate", {0, 7, 0, 0}, {.1, .2, .7}, {0, .15, 0, 0, .1, .75}, 1)),
      detectable(plain("Coffee_pitcher", {4, 0, 0, 0}, {1, 0, 0}, {0, .5, 0, 0, .1, .4}, 1)),
      packaged(plain("Chips", {4, 1, 0, 0}, {.95, 0, .05}, {.45, .2, .1, .25, 0, 0}, 1), {"Paprika", "Original"},
               "Pringles", "Pringles Paprika"),
      packaged(plain("Coffee", {8, 0, 0, 1}, {.2, 0, .8}, {.6, .3, 0, .05, 0, .05}, 1), {"Kaffee", "Crema"}, "Tchibo",
               "Feine Milde", "tchibo.de"),
      packaged(plain("Corn_flakes", {7, 0, 0, 0}, {0, .05, .95}, {.25, .4, 0, .1, .25, 0}, 1),
               {"Corn Flakes", "Toppas"}, "Kellogg's", "Kellogg's Corn Flakes", "kelloggs.de"),
      packaged(plain("Vitalis_Cereals", {6, 0, 0, 0}, {0, .05, .95}, {.4, .5, .05, 0, .05, 0}, 1),
               {"Vitalis", "Crunchy"}, "Dr Oetker", "Vitalis Crunchy", "oetker.de"),
      packaged(plain("Pancake_mix", {1, 5, 0, 0}, {.4, 0, .6}, {.3, .6, 0, 0, .1, 0}, 1), {"Pfannkuchen", "Mix"},
               "Dr Oetker", "Pancake Mix", "oetker.de"),
      packaged(plain("Ice_tea", {3, 0, 0, 5}, {.05, 0, .95}, {.05, .65, .1, .2, 0, 0}, 1), {"Eistee", "Pfirsich"},
               "Pfanner", "Pfanner Eistee"),
      packaged(plain("Juice", {6, 0, 0, 7}, {.05, 0, .95}, {.05, .65, .2, .05, .05, 0}, 1), {"Orange", "100 Prozent"},
               "Pfanner", "Pfanner Orange"),
      packaged(plain("Ketchup", {3, 2, 0, 4}, {.95, 0, .05}, {.95, 0, 0, 0, .03, .02}, .9), {"Tomato", "Ketchup"},
               "Heinz", "Heinz Tomato Ketchup", "heinz.de"),
      packaged(plain("Milk", {8, 1, 0, 9}, {.1, 0, .9}, {.05, .3, .15, .05, .45, 0}, 1), {"Voll Milch", "Milch"},
               "Weihenstephan", "Frische Vollmilch"),
      packaged(plain("Nutella", {5, 0, 0, 0}, {.95, 0, .05}, {.25, 0, 0, 0, .25, .5}, .3), {"nutella"}, "Ferrero",
               "Ferrero Nutella"),
      packaged(plain("Oil", {0, 8, 0, 1}, {1, 0, 0}, {0, .75, 0, .2, 0, .05}, .4), {"Sonnenblumen", "Oel"}, "ja!",
               "Reines Sonnenblumenoel"),
      packaged(plain("Salt", {3, 6, 0, 0}, {.6, 0, .4}, {0, .1, .3, 0, .6, 0}, .05), {"Jodsalz"}, "Bad Reichenhaller",
               "Alpensalz"),
      packaged(plain("Sugar", {4, 2, 0, 0}, {.1, 0, .9}, {0, 0, .35, 0, .65, 0}, .6), {"Zucker"}, "Suedzucker",
               "Feinster Zucker"),
      packaged(plain("Tea", {5, 0, 0, 0}, {0, .1, .9}, {.15, .35, 0, .45, .05, 0}, .5), {"Tee", "Kamille"}, "Teekanne",
               "Teekanne Kamille"),
  };
}

}  // namespace

KitchenConfig default_kitchen() {
  KitchenConfig config;
  config.contexts = {"Breakfast", "Cooking", "Drawer", "Fridge"};
  config.shapes = {"Round", "Flat", "Box"};
  config.colors = {"Red", "Yellow", "Blue", "Green", "White", "Black"};
  config.context_frequency = {25, 12, 7, 6};
  config.object_counts = {0, 0, 2, 5, 12, 16, 8, 6, 1};
  config.classes = default_classes();
  config.pairs = {
      {"Milk", "Corn_flakes", 3},
      {"Milk", "Vitalis_Cereals", 3},
      {"Bowl", "Corn_flakes", 2.5},
      {"Bowl", "Vitalis_Cereals", 2.5},
      {"Bowl", "Spoon", 2},
      {"Corn_flakes", "Vitalis_Cereals", 0.2},
      {"Corn_flakes", "Ketchup", 0.2},
      {"Vitalis_Cereals", "Ketchup", 0.2},
      {"Knife", "Fork", 3},
      {"Knife", "Plate", 2},
      {"Fork", "Plate", 2},
      {"Coffee", "Cup", 3},
      {"Coffee", "Coffee_pitcher", 3},
      {"Tea", "Cup", 2.5},
      {"Tea", "Coffee", 0.3},
      {"Sugar", "Tea", 2},
      {"Sugar", "Coffee", 2},
      {"Pancake_mix", "Hot_plate", 4},
      {"Spatula", "Hot_plate", 2.5},
      {"Oil", "Pot", 2},
      {"Salt", "Pot", 2},
      {"Pot", "Hot_plate", 0.5},
      {"Toaster", "Nutella", 2.5},
      {"Milk", "Juice", 0.6},
  };
  config.same_class = 0.35;
  config.shape_confusion = 0.1;
  config.color_confusion = 0.1;
  config.size_confusion = 0.05;
  config.second_shape = 0.48;
  config.another_color = 0.13;
  config.size_missing = 0.016;
  // Of printed things, which are 44 % of all: so that of all things 8.2 % have words, 11.2 % a sign, 20.1 % a similar picture
  // or another user's answer, and 6.3 % a product (48, 66, 62 + 56 and 37 of 587).
  config.text = {.19, .9};
  config.logo = {.26, .95};
  config.image = {.47, .7};
  config.product = {.147, .8};
  config.contact = {.02, 1};
  // The detector speaks of about a third of all things.
  config.detector = {.72, .5};
  return config;
}

}  // namespace sherlog
